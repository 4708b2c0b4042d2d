"""The lines that furniture follows, over level floors and floors with heights alike."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.geometry.polyline import arc_length, resample
from pipeline.remarks import warn_user
from pipeline.types import DriftNetwork

LEAST_HEIGHT_M = 2.9  # of workings: a duct under the roof then leaves 2 m below it

HeightsOver = Callable[[np.ndarray], np.ndarray]  # of points (n, 3) m over the floors: (n,) m


@dataclass(frozen=True)
class Way:
    """A line on the floor of a drift, m, mine frame.

    Attributes
    ----------
    floor_m : (n, 3) float64
    left_m, right_m : (n,) float64
        From there to the ribs.
    ends_at_junctions : (bool, bool)
        Whether it begins and ends at one.
    """

    floor_m: np.ndarray
    left_m: np.ndarray
    right_m: np.ndarray
    ends_at_junctions: tuple[bool, bool] = (False, False)

    @property
    def length_m(self) -> float:
        """Return its length, m."""
        return float(arc_length(self.floor_m)[-1])

    def places(self, spacing_m: float) -> Places:
        """Return places at even distances along it."""
        chainage, at = resample(self.floor_m, spacing_m)
        ahead = np.gradient(at[:, :2], axis=0) if len(at) > 2 else np.diff(at[:, :2], axis=0).repeat(2, axis=0)
        ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
        along = arc_length(self.floor_m)
        ribs = [np.interp(chainage, along, side_m) for side_m in (self.left_m, self.right_m)]
        return Places(at, np.column_stack([-ahead[:, 1], ahead[:, 0]]), ribs[0], ribs[1])


@dataclass(frozen=True)
class Places:
    """Places (n, 3) m on a floor, unit vectors (n, 2) to their left, and distances (n,) m to the left and right rib."""

    floor_m: np.ndarray
    left: np.ndarray
    left_m: np.ndarray
    right_m: np.ndarray

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.floor_m)

    def over(self, height_m: float) -> np.ndarray:
        """Return the places (n, 3) m so high over the floor."""
        return self.floor_m + np.array([0.0, 0.0, height_m])


def ways_of(network: DriftNetwork, height_m: float) -> list[Way]:
    """Return the legs of a level mine's network; none in workings too low for furniture, and a line says so."""
    ways: list[Way] = []
    if height_m < LEAST_HEIGHT_M:
        warn_user(f"realism.furnish: no furniture, workings of {height_m:g} m are lower than {LEAST_HEIGHT_M:g} m")
        return ways
    for leg in network.legs:
        half_m = np.full(len(leg.stations_m), float(np.median(leg.half_width_m)))
        ends = leg.start in network.junctions, leg.end in network.junctions
        ways.append(Way(on_level(leg.stations_m), half_m, half_m, ends))
    return ways


def on_level(line_m: object) -> np.ndarray:
    """Return a line (n, 2) m on the floor z = 0."""
    line = np.array(line_m, np.float64)
    return np.column_stack([line, np.zeros(len(line))])


def over_level(points_m: np.ndarray) -> np.ndarray:
    """Return the heights of points (n, 3) m over the floor z = 0."""
    found: np.ndarray = points_m[:, 2]
    return found
