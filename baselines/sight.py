"""Which coverage cells can have been seen from a robot's way: cells in line of sight of its places, at their times."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_dilation

from minexplore.coverage import CoverageGrid
from minexplore.world import World

SURFACE_M = 0.5  # how far behind the collision wall the visible rock may stand back
_LATTICE_M = 0.75  # between the places from which views are taken
_BESIDE_M = 1.0  # beyond where the robot can have been, places still count: the nearest one may stand in rock


class Sight:
    """The reachable coverage cells in view from places of a mine.

    A view looks in all directions along the plan, past walls that stand back by `SURFACE_M`, and further than the beams
    by the distance between two places. So it holds every cell that a robot near the place can see, and a few more.
    Views are taken when they are needed, and kept.
    """

    def __init__(self, world: World, grid: CoverageGrid, range_m: float) -> None:
        """Take the world, its reachable cells and the range of the beams, m."""
        self._world, self._every = world, max(1, round(_LATTICE_M / world.cell_m))
        self.total = grid.total
        reach = int(np.ceil((range_m + _LATTICE_M) / world.cell_m))
        open_ = binary_dilation(world.clearance_m > 0, iterations=max(1, round(SURFACE_M / world.cell_m)))
        self._open = np.pad(open_, reach)  # closed all round, so that no ray leaves the map
        self._cells = np.pad(_number_cells(world, grid), reach, constant_values=-1)
        self._standing = np.pad(world.clearance_m > 0, reach)
        self._low = world.origin_m - reach * world.cell_m
        angle = np.linspace(0, 2 * np.pi, int(np.ceil(2 * np.pi * reach)), endpoint=False)[:, None]
        steps = np.arange(reach + 1)
        row, col = (np.rint(along * steps).astype(int) for along in (np.sin(angle), np.cos(angle)))
        self._rays = (row * self._open.shape[1] + col).astype(np.int32)  # (rays, steps) offsets in the flattened map
        self._views: dict[int, np.ndarray] = {}

    def cells_between(self, start_m: np.ndarray, end_m: np.ndarray, path_m: float) -> np.ndarray:
        """Return which cells (total,) bool are in view on a path of at most `path_m` between two places (2,)."""
        cell, every = self._world.cell_m, self._every
        half = (path_m + 2 * _BESIDE_M) / 2
        middle = (start_m + end_m) / 2
        low, high = (np.floor((middle + side * half - self._low) / cell).astype(int) for side in (-1, 1))
        low = np.maximum(low // every * every, 0)
        high = np.minimum(high + 1, np.array(self._open.shape[::-1]) - 1)
        col, row = np.meshgrid(np.arange(low[0], high[0] + 1, every), np.arange(low[1], high[1] + 1, every))
        places = self._low + (np.stack([col, row], axis=-1) + 0.5) * cell
        around = np.linalg.norm(places - start_m, axis=-1) + np.linalg.norm(places - end_m, axis=-1)
        near = (around <= path_m + 2 * _BESIDE_M) & self._standing[row, col]
        views = [self._view(flat) for flat in (row[near] * self._open.shape[1] + col[near]).tolist()]
        if not views:
            return np.zeros(self.total, dtype=bool)
        return np.unpackbits(np.bitwise_or.reduce(views, axis=0), count=self.total).astype(bool)

    def _view(self, place: int) -> np.ndarray:
        """Return the cells in view from a place, packed into bits; the place is an index in the flattened map."""
        if place not in self._views:
            at = place + self._rays
            clear = np.logical_and.accumulate(self._open.ravel()[at], axis=1)
            found = np.zeros(self.total + 1, dtype=bool)  # the last is what no reachable cell holds
            found[self._cells.ravel()[at[clear]]] = True
            self._views[place] = np.packbits(found[:-1])
        return self._views[place]


def _number_cells(world: World, grid: CoverageGrid) -> np.ndarray:
    """Return the number of the reachable coverage cell that each cell of the world's map lies in, -1 for none."""
    numbers: np.ndarray = np.full(grid.reachable.shape, -1, dtype=np.int32)
    numbers[grid.reachable] = np.arange(grid.total)
    rows, cols = world.clearance_m.shape
    col = _index((np.arange(cols) + 0.5) * world.cell_m + world.origin_m[0] - grid.origin_m[0], grid, numbers.shape[1])
    row = _index((np.arange(rows) + 0.5) * world.cell_m + world.origin_m[1] - grid.origin_m[1], grid, numbers.shape[0])
    found = np.where((row >= 0)[:, None] & (col >= 0), numbers[row[:, None], col], -1)
    return found.astype(np.int32)


def _index(places_m: np.ndarray, grid: CoverageGrid, count: int) -> np.ndarray:
    """Return the column or row of coverage cells at distances (n,) m from the grid's corner, -1 beyond the last."""
    index = np.floor(places_m / grid.cell_m).astype(int)
    return np.where(index < count, index, -1)
