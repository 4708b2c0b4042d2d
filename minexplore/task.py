"""The task's parameters: those that the paper fixes, and those that it leaves open."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")


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
        if self.beams < 1 or not 0 < self.range_m[0] < self.range_m[1]:
            raise ValueError(
                f"task: beams = {self.beams}, range_m = {self.range_m}; want one beam or more and 0 < near < far"
            )
        if not 0 < self.physics_s <= self.control_s:
            raise ValueError(
                f"task: physics_s = {self.physics_s}, control_s = {self.control_s}; want 0 < physics <= control"
            )

    @property
    def substeps(self) -> int:
        """Return the physics steps of one control step."""
        return round(self.control_s / self.physics_s)


def coerce_params(kind: type[T], value: T | dict[str, Any] | None) -> T:
    """Return parameters given as an instance, as a dict of some fields, or as None for the defaults.

    Raises
    ------
    ValueError
        If a dict has an unknown field; the message lists the known ones.
    """
    if value is None:
        return kind()
    if isinstance(value, kind):
        return value
    asked: dict[str, Any] = dict(value)  # type: ignore[arg-type]
    names = [f.name for f in fields(kind)]  # type: ignore[arg-type]
    unknown = sorted(set(asked) - set(names))
    if unknown:
        raise ValueError(f"{kind.__name__}: no field {unknown[0]!r}; there are {', '.join(names)}")
    return kind(**{k: tuple(v) if isinstance(v, list) else v for k, v in asked.items()})
