"""The own maps of several robots in one mine as one stack of arrays, so that one call adds the beams of all."""

from __future__ import annotations

import numpy as np

from baselines.explorers.maps.own_map import FINE, FREE, ROCK, OwnMap
from minexplore.sensing.coverage import CoverageGrid

_RIM_M = 14.0  # of ground round the workings, which beams and frontiers do not leave


class MapStack:
    """`seen[r]` and `fine[r]` are the map of robot r, as `OwnMap` has it, of fixed extent."""

    def __init__(self, grid: CoverageGrid, count: int) -> None:
        """Make empty maps that hold all that can be seen in a mine."""
        rim = int(np.ceil(_RIM_M / grid.cell_m))
        rows, cols = np.array(grid.reachable.shape) + 2 * rim
        self.low = np.rint(grid.origin_m / grid.cell_m).astype(int) - rim
        self.cell_m, self.fine_m = grid.cell_m, grid.cell_m / FINE
        self.seen = np.zeros((count, rows, cols), dtype=bool)
        self.fine = np.zeros((count, rows * FINE, cols * FINE), dtype=np.uint8)

    def view(self, robot: int) -> OwnMap:
        """Return the map of one robot; it shares the stack's memory."""
        own = OwnMap(self.cell_m)
        own.low, own.seen, own.fine = self.low, self.seen[robot], self.fine[robot]
        return own

    def clear(self, robot: int) -> None:
        """Empty one robot's map."""
        self.seen[robot], self.fine[robot] = False, 0

    def add(
        self, robots: np.ndarray, poses: np.ndarray, bearings: np.ndarray, ranges: np.ndarray, far_m: float
    ) -> None:
        """Add the beams of robots (k,) at poses (k, 3): bearings (beams,) rad, ranges (k, beams) m; as `OwnMap.add`."""
        angles = poses[:, 2:] + bearings
        along = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        steps = np.arange(0.0, far_m, self.fine_m / 2)
        reach = np.minimum(steps, np.maximum(ranges - self.fine_m / 4, 0.0)[..., None])
        passed = self._at(robots, poses[:, None, None, :2] + along[:, :, None] * reach[..., None])
        fine, seen = self.fine.reshape(-1), self.seen.reshape(-1)
        place, row, col = np.unravel_index(passed, self.fine.shape)
        seen[np.ravel_multi_index((place, row // FINE, col // FINE), self.seen.shape)] = True
        fine[passed[fine[passed] != ROCK]] = FREE
        hit = ranges < far_m - 0.05
        ends = poses[:, None, :2] + along * (ranges + self.fine_m / 4)[..., None]
        fine[self._at(robots, ends)[hit]] = ROCK

    def _at(self, robots: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return the flat numbers, of the stack's fine cells, of places (k, ..., 2) m of robots (k,)."""
        cell = np.floor(places / self.fine_m + 1e-9).astype(int) - self.low * FINE
        _, rows, cols = self.fine.shape
        first = (robots * rows).reshape(-1, *[1] * (places.ndim - 2))
        return (first + cell[..., 1]) * cols + cell[..., 0]
