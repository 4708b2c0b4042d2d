"""The task's parameters: those that the paper fixes, and those that it leaves open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np

from minexplore.limits import Span, check_numbers

T = TypeVar("T")

LONG = 1_000_000_000  # steps: an episode that never ends by itself
_RANGE = Span(0.0, 1000.0)
_SPANS = {
    "beams": Span(1, 4096, whole=True),
    "range_noise_m": Span(0.0, 10.0),
    "max_forward_mps": Span(0.0, 50.0),
    "max_turn_radps": Span(0.0, 50.0),
    "max_steps": Span(1, LONG, whole=True),
    "stall_steps": Span(1, LONG, whole=True),
    "stall_speed_mps": Span(0.0, 50.0),
    "control_s": Span(1e-4, 10.0),
    "cell_m": Span(0.1, 1000.0),
    "physics_s": Span(1e-5, 0.1),
    "region_m": Span(0.1, np.inf),
}


@dataclass(frozen=True)
class TaskParams:
    """The exploration task.

    The paper gives the first block. It leaves the second open: physics step, radius of the area that counts round the
    entrance, zones' effects and tilt on or off.
    """

    beams: int = 16
    range_m: tuple[float, float] = (0.12, 10.0)
    range_noise_m: float = 0.01
    max_forward_mps: float = 1.5
    max_turn_radps: float = 1.5
    max_steps: int = 6000
    stall_steps: int = 100
    stall_speed_mps: float = 0.01
    control_s: float = 0.1
    cell_m: float = 2.0

    physics_s: float = 0.005
    region_m: float = np.inf
    terrain: bool = True
    tilt: bool = True

    def __post_init__(self) -> None:
        """Refuse values that make no task."""
        check_numbers("task", self, _SPANS)
        for name in ("terrain", "tilt"):
            if not isinstance(getattr(self, name), bool | np.bool_):
                raise ValueError(f"task: {name} = {getattr(self, name)!r}: want True or False")
        pair = isinstance(self.range_m, tuple) and len(self.range_m) == 2 and all(map(_RANGE.accepts, self.range_m))
        if not pair or not 0 < self.range_m[0] < self.range_m[1]:
            raise ValueError(f"task: range_m = {self.range_m!r}: want 0 < near < far, at most {_RANGE.high:g} m")
        steps = self.control_s / self.physics_s
        if steps < 1 or abs(steps - round(steps)) > 1e-6 * steps:
            raise ValueError(
                f"task: physics_s = {self.physics_s}, control_s = {self.control_s}; want a whole number of physics "
                f"steps in a control step, they make {steps:g}"
            )

    @property
    def substeps(self) -> int:
        """Return the physics steps of one control step."""
        return round(self.control_s / self.physics_s)


def coerce_params(kind: type[T], value: T | Mapping[str, Any] | None) -> T:
    """Return parameters given as an instance, as a dict of some fields, or as None for the defaults.

    Raises
    ------
    ValueError
        If it is none of these, or a dict has an unknown field; the message lists the known ones.
    """
    if value is None:
        return kind()
    if isinstance(value, kind):
        return value
    if not isinstance(value, Mapping):
        raise ValueError(f"{kind.__name__}: {value!r}: want {kind.__name__}(...), or a dict of its fields")
    asked: dict[str, Any] = dict(value)
    names = [f.name for f in fields(kind)]  # type: ignore[arg-type]
    unknown = sorted(set(asked) - set(names))
    if unknown:
        raise ValueError(f"{kind.__name__}: no field {unknown[0]!r}; there are {', '.join(names)}")
    return kind(**{k: tuple(v) if isinstance(v, list) else v for k, v in asked.items()})
