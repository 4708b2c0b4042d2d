"""Where a LiDAR looks and when."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from minexplore.limits import Span, check_numbers

_SPANS = {
    "rate_hz": Span(1e-4, 1e6),
    "range_at_ten_percent_m": Span(0.001, 1e6),
    "noise_m": Span(0.0, 1000.0),
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
    about: dict[str, Any] = field(hash=False)

    def __post_init__(self) -> None:
        """Refuse numbers that no LiDAR has."""
        check_numbers(f"LiDAR {self.name}", self, _SPANS)
        near, far = self.range_m
        if not 0 < near < far < math.inf:
            raise ValueError(f"LiDAR {self.name}: range_m = {self.range_m}: want 0 < near < far")

    def scan(self, number: int = 0) -> Rays:
        """Return the rays of a scan by its number; all scans are alike but those of a rosette."""
        return _rosette(self, number) if self.kind == "rosette" else _repeated(self)

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


@functools.lru_cache(maxsize=4)
def _repeated(pattern: ScanPattern) -> Rays:
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
