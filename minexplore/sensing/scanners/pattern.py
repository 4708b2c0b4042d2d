"""Where a LiDAR looks and when: patterns as data files, from data sheets."""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

_FOLDER = Path(__file__).parent / "patterns"
_KINDS = ("spinning", "rosette", "lines")
_SHARED = {"kind", "source", "rate_hz", "elevations_deg", "range_m", "range_at_ten_percent_m", "noise_m"}
_OWN = {
    "spinning": {"columns", "azimuths_deg", "firing_s"},
    "rosette": {"points_hz", "turns_hz", "swings_hz", "fan_deg"},
    "lines": {"columns", "lines"},
}


@dataclass(frozen=True)
class Rays:
    """The rays of one scan, in the order in which they are fired.

    `directions` (n, 3) float32 unit vectors, x ahead, z up; `ring` (n,) uint16, the channel, from the pattern's first;
    `time_s` (n,) float32 since the scan began.
    """

    directions: np.ndarray
    ring: np.ndarray
    time_s: np.ndarray


@dataclass(frozen=True)
class ScanPattern:
    """A LiDAR as its data sheet describes it.

    `rate_hz` counts scans. `range_m` is (nearest, farthest), `range_at_ten_percent_m` the farthest at which a
    perpendicular surface of 10 % reflectivity returns, `noise_m` the standard deviation of a range. `about` holds what
    the kind of pattern needs beside: columns, channels or rates.
    """

    name: str
    kind: str
    source: str
    rate_hz: float
    elevations_deg: tuple[float, ...]
    range_m: tuple[float, float]
    range_at_ten_percent_m: float
    noise_m: float
    about: dict[str, Any]

    def scan(self, number: int = 0) -> Rays:
        """Return the rays of a scan by its number; all scans are alike but those of a rosette."""
        return _rosette(self, number) if self.kind == "rosette" else _repeated(self.name)

    @property
    def rays(self) -> int:
        """Return how many rays a scan has."""
        if self.kind == "rosette":
            return round(self.about["points_hz"] / self.rate_hz)
        return self.about["columns"] * (self.about["lines"] if self.kind == "lines" else len(self.elevations_deg))

    @property
    def period_s(self) -> float:
        """Return how long one scan takes."""
        return 1 / self.rate_hz


def pattern_names() -> list[str]:
    """Return the names of the patterns that ship with the package."""
    return sorted(path.stem for path in _FOLDER.glob("*.json"))


@functools.cache
def load_pattern(name: str) -> ScanPattern:
    """Return a pattern by its name.

    Raises
    ------
    ValueError
        If there is none of that name; the message lists those that there are.
    """
    if name not in pattern_names():
        raise ValueError(f"LiDAR = {name!r}: valid choices are {', '.join(pattern_names())}")
    return parse_pattern(name, json.loads((_FOLDER / f"{name}.json").read_text()))


def parse_pattern(name: str, record: dict[str, Any]) -> ScanPattern:
    """Return a pattern as its file states it.

    Raises
    ------
    ValueError
        If a field is missing or unknown, or the kind is.
    """
    kind = record.get("kind")
    if kind not in _KINDS:
        raise ValueError(f"{name}: kind = {kind!r}: valid choices are {', '.join(_KINDS)}")
    wrong = set(record) ^ (_SHARED | _OWN[kind])
    if wrong:
        raise ValueError(f"{name}: {sorted(wrong)[0]}: missing or unknown in a pattern of kind {kind!r}")
    near, far = record["range_m"]
    if not 0 < near < far:
        raise ValueError(f"{name}: range_m = {record['range_m']}: want 0 < near < far")
    shared = {field: record[field] for field in _SHARED - {"elevations_deg", "range_m"}}
    own = {field: record[field] for field in _OWN[kind]}
    return ScanPattern(
        name=name, elevations_deg=tuple(record["elevations_deg"]), range_m=(near, far), about=own, **shared
    )


@functools.lru_cache(maxsize=4)
def _repeated(name: str) -> Rays:
    pattern = load_pattern(name)
    return _spinning(pattern) if pattern.kind == "spinning" else _lines(pattern)


def _spinning(pattern: ScanPattern) -> Rays:
    """Return the rays of channels on a head that turns clockwise seen from above, column by column."""
    columns = pattern.about["columns"]
    azimuth = -np.arange(columns)[:, None] * 2 * np.pi / columns + np.radians(pattern.about["azimuths_deg"])
    elevation = np.broadcast_to(np.radians(pattern.elevations_deg), azimuth.shape)
    time_s = np.arange(columns)[:, None] * pattern.period_s / columns + np.array(pattern.about["firing_s"])
    # Rings are numbered from the lowest, as makers' drivers do.
    ring = np.argsort(np.argsort(pattern.elevations_deg, kind="stable"), kind="stable")
    return _rays(azimuth, elevation, np.tile(ring, columns), time_s)


def _lines(pattern: ScanPattern) -> Rays:
    """Return the rays of upright lines, one a column, while the head turns once."""
    columns, lines = pattern.about["columns"], pattern.about["lines"]
    first, last = np.radians(pattern.elevations_deg)
    azimuth = np.broadcast_to(-np.arange(columns)[:, None] * 2 * np.pi / columns, (columns, lines))
    elevation = np.broadcast_to(np.linspace(first, last, lines), (columns, lines))
    time_s = np.arange(columns * lines) * pattern.period_s / (columns * lines)
    return _rays(azimuth, elevation, np.tile(np.arange(lines)[::-1], columns), time_s)


def _rosette(pattern: ScanPattern, number: int) -> Rays:
    """Return the rays of a scan of a pattern that does not repeat.

    A fan of lines, which are fired together, turns about the upright fast and swings up and down slowly. It turns about
    its own middle once a turn, as the mirror does that throws it.
    """
    about = pattern.about
    count = pattern.rays
    fan = np.radians(about["fan_deg"])
    lines = np.arange(count) % len(fan)
    time_s = np.arange(count) / about["points_hz"]
    fired_s = (np.arange(count) - lines) / about["points_hz"] + number * pattern.period_s
    turned = 2 * np.pi * about["turns_hz"] * fired_s
    low, high = np.radians(pattern.elevations_deg)
    reach = (high - low) / 2 - fan[:, 0].max()
    middle = (low + high) / 2 + reach * np.cos(2 * np.pi * about["swings_hz"] * fired_s)
    azimuth = turned + fan[lines, 1] * np.sin(turned) / np.cos(middle)
    elevation = middle + fan[lines, 0] * np.cos(turned)
    return _rays(azimuth, elevation, lines, time_s)


def _rays(azimuth: np.ndarray, elevation: np.ndarray, ring: np.ndarray, time_s: np.ndarray) -> Rays:
    level = np.cos(elevation)
    directions = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1)
    found = Rays(
        np.ascontiguousarray(directions.reshape(-1, 3), dtype=np.float32),
        np.ascontiguousarray(ring.reshape(-1), dtype=np.uint16),
        np.ascontiguousarray(time_s.reshape(-1), dtype=np.float32),
    )
    for array in (found.directions, found.ring, found.time_s):
        array.setflags(write=False)  # scans share them
    return found
