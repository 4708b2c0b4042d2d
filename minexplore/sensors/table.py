"""The table of sensors: names, spaces, and which kind reads each."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any

import gymnasium

if TYPE_CHECKING:
    from minexplore.sensors.kind import SensorKind

_FOLDER = Path(__file__).parent / "kinds"


def kinds() -> tuple[type[SensorKind], ...]:
    """Return all kinds of sensors, the package's own first and by the names of their files, in whatever order imported.

    Their modules are imported when this is first asked for.
    """
    from minexplore.sensors.kind import KINDS

    for module in sorted(found.name for found in iter_modules([str(_FOLDER)])):
        import_module(f"{__package__}.{_FOLDER.name}.{module}")
    folder = f"{__package__}.{_FOLDER.name}."
    own = sorted((kind for kind in KINDS if kind.__module__.startswith(folder)), key=lambda kind: kind.__module__)
    return (*own, *(kind for kind in KINDS if not kind.__module__.startswith(folder)))


def sensor_names() -> list[str]:
    """Return the names of all sensors."""
    return [name for kind in kinds() for name in kind.names()]


def kind_of(name: str) -> type[SensorKind]:
    """Return the kind that reads a sensor."""
    return next(kind for kind in kinds() if name in kind.names())


def check_sensors(names: Any) -> tuple[str, ...]:
    """Return the names of sensors as a tuple.

    Raises
    ------
    ValueError
        If they are no sequence of known names, each once.
    """
    if isinstance(names, list | tuple) and not names:
        return ()
    known = sensor_names()
    if isinstance(names, str) or not isinstance(names, Sequence):
        raise ValueError(f"sensors = {names!r:.100}: want a list of {', '.join(known)}")
    for name in names:
        if name not in known or list(names).count(name) > 1:
            raise ValueError(f"sensors: {name!r:.100}: want each once of {', '.join(known)}")
    return tuple(names)


def observed_space(own: gymnasium.spaces.Box, names: Sequence[str]) -> gymnasium.spaces.Space:
    """Return the space of an observation: a robot's own, or with sensors a dict that holds it as `robot`."""
    return gymnasium.spaces.Dict({"robot": own, **{name: sensor_space(name) for name in names}}) if names else own


def sensor_space(name: str) -> gymnasium.spaces.Box:
    """Return the space of a sensor in an observation."""
    return kind_of(name).space(name)
