"""Which cubes of the workings a robot that flies can reach, and which its beams have seen."""

from __future__ import annotations

import math

import numpy as np

from minexplore.sensing.coverage import connected_cells
from minexplore.world import World

_STEP_M = 0.5  # between heights at which a place is looked at; cubes are 2 m
_CENTRE = 0.01  # m inside a free height: the border of a cube belongs to the upper one


class CubeGrid:
    """Cubes over the mine frame, of which the reachable ones are numbered from 0 to `total` - 1.

    `reachable` (total,) is true; a column lies over origin + (j, i) * cell.
    """

    def __init__(self, middles_m: np.ndarray, cell_m: float) -> None:
        """Take points (n, 3) m of the mine frame at which the robot's middle can be, one or more in each cube.

        Raises
        ------
        ValueError
            If there is no point.
        """
        if not len(middles_m):
            raise ValueError("no place where the robot fits")
        self.cell_m = cell_m
        cubes = np.unique(np.floor(middles_m / cell_m).astype(int), axis=0)
        low = cubes.min(axis=0)
        self.low, self._size = low, cubes.max(axis=0) - low + 1
        self.origin_m = low[:2] * cell_m
        self._keys = np.ravel_multi_index((cubes - low).T, self._size)  # in order, as cubes are
        self.cubes, self.total = cubes, len(cubes)
        self.reachable = np.ones(self.total, dtype=bool)
        self._columns = int(self._size[1]), int(self._size[0])
        self._flat = np.ravel_multi_index((cubes - low)[:, 1::-1].T, self._columns)

    def numbers_at(self, points_m: np.ndarray) -> np.ndarray:
        """Return the numbers (n,) of the cubes about points (n, 3) m of the mine frame; -1 for those not reachable."""
        at = np.floor(points_m / self.cell_m).astype(int) - self.low
        inside = np.flatnonzero(((at >= 0) & (at < self._size)).all(axis=1))
        key = np.ravel_multi_index(at[inside].T, self._size)
        number = np.minimum(np.searchsorted(self._keys, key), self.total - 1)
        is_cube = self._keys[number] == key
        found = np.full(len(points_m), -1)
        found[inside[is_cube]] = number[is_cube]
        return found

    def cells_crossed(self, starts_m: np.ndarray, ends_m: np.ndarray, longest_m: float) -> tuple[np.ndarray, ...]:
        """Return ray numbers and cube numbers of all reachable cubes that segments (n, 3) to (n, 3) m pass through.

        Exact: each segment is cut at every plane of the grid that it crosses, and each piece names the cube of its
        middle.
        """
        starts_m = np.broadcast_to(starts_m, ends_m.shape)
        start, step = starts_m / self.cell_m, (ends_m - starts_m) / self.cell_m
        lines = np.arange(1, int(np.ceil(longest_m / self.cell_m)) + 2)
        behind = np.where(step > 0, np.floor(start), np.ceil(start))
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (behind[..., None] + np.sign(step)[..., None] * lines - start[..., None]) / step[..., None]
        share = np.where((share > 0) & (share < 1), share, 1.0).reshape(len(start), -1)
        at = np.sort(np.hstack([np.zeros((len(start), 1)), share, np.ones((len(start), 1))]), axis=1)
        ray, piece = np.nonzero(at[:, 1:] > at[:, :-1])
        middle = (at[ray, piece + 1] + at[ray, piece]) / 2
        number = self.numbers_at((start[ray] + middle[:, None] * step[ray]) * self.cell_m)
        return ray[number >= 0], number[number >= 0]

    def between(self, places_m: np.ndarray, low_m: np.ndarray, high_m: np.ndarray) -> np.ndarray:
        """Return which cubes (total,) are over places (n, 2) m of the plan, in part between heights (n,) m."""
        at = np.floor((places_m - self.origin_m) / self.cell_m).astype(int)
        ends = [np.floor(height_m / self.cell_m).astype(int) - self.low[2] for height_m in (low_m, high_m)]
        inside = ((at >= 0) & (at < self._size[:2])).all(axis=1) & (ends[0] < self._size[2]) & (ends[1] >= 0)
        column = (at[:, 0] * self._size[1] + at[:, 1])[inside] * self._size[2]
        bottom, top = (np.clip(end[inside], 0, self._size[2] - 1) for end in ends)
        first, last = np.searchsorted(self._keys, column + bottom), np.searchsorted(self._keys, column + top + 1)
        begun, ended = (np.bincount(those, minlength=self.total + 1)[:-1] for those in (first, last))
        found: np.ndarray = np.cumsum(begun - ended) > 0
        return found

    def in_plan(self, cells: np.ndarray) -> np.ndarray:
        """Return over which columns (rows, cols) some cubes (total,) are."""
        found = np.zeros(self._columns, dtype=bool)
        found.reshape(-1)[self._flat[cells]] = True
        return found


def level_middles(
    world: World, radius_m: float, half_height_m: float, centre_m: np.ndarray, reach_m: float
) -> np.ndarray:
    """Return points (n, 3) m of a level mine at which an upright cylinder has its middle.

    They are connected to `centre_m` over the floor and within `reach_m` of it, seen from above.
    """
    row, col = np.nonzero(connected_cells(world, world.clearance_m >= radius_m, centre_m))
    places = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
    if math.isfinite(reach_m):
        places = places[np.linalg.norm(places - centre_m, axis=1) <= reach_m]
    least = half_height_m + _CENTRE
    most = float(world.record["height_m"]) - half_height_m - _CENTRE
    heights = np.minimum(np.arange(least, most + _STEP_M, _STEP_M), most) if most >= least else np.zeros(0)
    return np.column_stack([np.repeat(places, len(heights), axis=0), np.tile(heights, len(places))])
