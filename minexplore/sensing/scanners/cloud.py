"""A point cloud as a LiDAR returns it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from minexplore.sensing.scanners.labels import LABELS


@dataclass(frozen=True)
class PointCloud:
    """The returns of one scan, in the order in which they were fired; rays without a return are left out.

    `directions` (n, 3) float32 unit vectors of the sensor's frame (x ahead, y left, z up), `range_m` (n,) float32,
    `ring` (n,) uint16, `time_s` (n,) float32 since the scan began, `intensity` (n,) float32 from 0 to 1 (reflectivity
    times the cosine of incidence, less what dust takes), `label` (n,) uint8 of `LABELS`, `ray` (n,) int64 its number
    among the `fired` ones.
    """

    directions: np.ndarray
    range_m: np.ndarray
    ring: np.ndarray
    time_s: np.ndarray
    intensity: np.ndarray
    label: np.ndarray
    ray: np.ndarray
    fired: int

    @property
    def points_m(self) -> np.ndarray:
        """Return the points (n, 3) float32, m, sensor's frame; each by the sensor's pose when its ray was fired."""
        points: np.ndarray = self.directions * self.range_m[:, None]
        return points

    def ranges_m(self) -> np.ndarray:
        """Return the ranges (fired,) float32 m of all rays that were fired, 0 where there is no return."""
        ranges = np.zeros(self.fired, dtype=np.float32)
        ranges[self.ray] = self.range_m
        return ranges

    def without(self, name: str) -> np.ndarray:
        """Return which points (n,) have another label than this one of `LABELS`."""
        other: np.ndarray = self.label != LABELS.index(name)
        return other

    def counts(self) -> dict[str, int]:
        """Return how many points have each label, without those that none has."""
        found = np.bincount(self.label, minlength=len(LABELS))
        return {name: int(count) for name, count in zip(LABELS, found, strict=True) if count}

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.range_m)
