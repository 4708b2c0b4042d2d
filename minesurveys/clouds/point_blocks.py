"""Blocks of points as readers yield them: places, and where they are wanted and stated, colours and times."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from dataclasses import field as field_of

import numpy as np

_MOST = 65_535  # of a channel: LAS has 16 bits
_NAMES = {  # of fields and columns in files
    "red": {"r", "red", "colorred"},
    "green": {"g", "green", "colorgreen"},
    "blue": {"b", "blue", "colorblue"},
    "time": {"time", "time_s", "t", "timestamp", "timestamp_s", "gps_time", "gpstime"},
}
COLOURS = ("red", "green", "blue")


@dataclass(frozen=True)
class Wanted:
    """What is read of points beside their places, where a file states it."""

    colours: bool = False
    times: bool = False


PLACES = Wanted()


@dataclass(frozen=True)
class StatedSystem:
    """What a file states of its coordinates: the system as well-known text, empty if none.

    `plan_m` and `up_m` are metres a unit of the plan and of heights where the file states them beside the system, and
    `step` is the smallest difference of two coordinates, in the file's unit.
    """

    wkt: str = ""
    plan_m: float | None = None
    up_m: float | None = None
    step: float = field_of(default=0.0, compare=False)


NO_SYSTEM = StatedSystem()


@dataclass(frozen=True)
class PointBlock:
    """Points (n, 3) in a file's units, with colours (n, 3) and times (n,) where these are wanted and stated.

    Colours are red, green and blue as the file has them, from 0 to 65,535. Black is none: scanners write it where no
    camera saw. A time that is not known is NaN. `system` is what the file states of the places' units and axes.
    """

    points: np.ndarray
    colours: np.ndarray | None = None
    times: np.ndarray | None = None
    system: StatedSystem = NO_SYSTEM

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.points)


def fields_of(names: Iterable[str], wanted: Wanted) -> dict[str, str]:
    """Return the file's own names of `red`, `green` and `blue`, all or none, and of `time`, as they are wanted."""
    found: dict[str, str] = {}
    for name in names:
        plain = name.lower().removeprefix("scalar_")
        for field, alike in _NAMES.items():
            if plain in alike:
                found.setdefault(field, name)
    has_colours = wanted.colours and set(COLOURS) <= set(found)
    kept = (*(COLOURS if has_colours else ()), *(("time",) if wanted.times else ()))
    return {field: found[field] for field in kept if field in found}


def block_of(points: np.ndarray, fields: Mapping[str, np.ndarray], system: StatedSystem = NO_SYSTEM) -> PointBlock:
    """Return points (n, 3) with the fields (n,) `red`, `green`, `blue` and `time` that there are.

    A colour with a channel that is no number from 0 to 65,535 is none, and so is a time that is not finite.
    """
    colours = times = None
    if "red" in fields:
        colours = np.column_stack([np.asarray(fields[name], float) for name in COLOURS])
        with np.errstate(invalid="ignore"):
            colours[~((colours >= 0) & (colours <= _MOST)).all(axis=1)] = 0.0
    if "time" in fields:
        times = np.asarray(fields["time"], float)
        times = np.where(np.isfinite(times), times, np.nan)
    return PointBlock(np.asarray(points, float), colours, times, system)


def mean_colours(sums: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Return the means (n, 3) uint8 of sums of colours (n, 3) over `count` (n,) points each.

    Where no point has a colour it is black; there are none, (0, 3), if no point has. Values beyond 255 are taken for 16
    bits, values of 1 at most for shares.
    """
    seen = count > 0
    if not seen.any():
        return np.zeros((0, 3), np.uint8)
    means = sums / np.maximum(count, 1)[:, None]
    most = float(means.max())
    means *= 255.0 if most <= 1 else 1.0 if most <= 255 else 255 / _MOST
    return np.asarray(np.rint(means), np.uint8)
