"""Which cubes of the workings a robot that flies can reach, and which its beams have seen."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from minexplore.floors.shaft_axis import has_fence
from minexplore.sensing.coverage import _connected, _distances
from minexplore.world import World

_STEP_M = 0.5  # between heights at which a place is looked at; cubes are 2 m
_CENTRE = 0.01  # m inside a free height: the border of a cube belongs to the upper one
_SHAFT_STEP_M = 0.25
_MOUTH_M = 3.0  # round the middle of a collar, east and north: there begin the workings that a shaft leads to


class CubeGrid:
    """Cubes over the mine frame, of which the reachable ones are numbered from 0 to `total` - 1.

    `reachable` (total,) is true; a column lies over origin + (j, i) * cell.
    """

    def __init__(
        self, world: World, cell_m: float, radius_m: float, half_height_m: float, centre_m: np.ndarray, reach_m: float
    ) -> None:
        """Find the cubes where an upright cylinder has its middle, connected to `centre_m` and within `reach_m` of it.

        Places are connected over the floor and, where shafts are open, by them.
        """
        self.cell_m = cell_m
        found = _places(world, radius_m, centre_m)
        row, col = np.nonzero(found)
        places = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
        if math.isfinite(reach_m):
            places = places[_distances(world, places, centre_m) <= reach_m]
        shafts = [shaft for shaft in _open(world, radius_m) if _leads(world, places, shaft)]
        middles = np.concatenate([_column(world, places, half_height_m), *(_axis(world, shaft) for shaft in shafts)])
        cubes = np.unique(np.floor(middles / cell_m).astype(int), axis=0)
        low = cubes.min(axis=0)
        self.low, size = low, cubes.max(axis=0) - low + 1
        self.origin_m = low[:2] * cell_m
        self._number = np.full(size, -1, dtype=np.int32)
        self._number[tuple((cubes - low).T)] = np.arange(len(cubes))
        self.cubes, self.total = cubes, len(cubes)
        self.reachable = np.ones(self.total, dtype=bool)
        self._columns = int(size[1]), int(size[0])
        self._flat = np.ravel_multi_index((cubes - low)[:, 1::-1].T, self._columns)

    def numbers_at(self, points_m: np.ndarray) -> np.ndarray:
        """Return the numbers (n,) of the cubes about points (n, 3) m of the mine frame; -1 for those not reachable."""
        at = np.floor(points_m / self.cell_m).astype(int) - self.low
        inside = ((at >= 0) & (at < self._number.shape)).all(axis=1)
        found = np.full(len(points_m), -1)
        found[inside] = self._number[tuple(at[inside].T)]
        return found

    def cells_crossed(self, starts_m: np.ndarray, ends_m: np.ndarray, longest_m: float) -> tuple[np.ndarray, ...]:
        """Return ray numbers and cube numbers of all reachable cubes that segments (n, 3) to (n, 3) m pass through.

        Exact: each segment is cut at every plane of the grid that it crosses, and each piece names the cube of its
        middle.
        """
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

    def mark(self, seen: np.ndarray, observer: np.ndarray, *cell: np.ndarray) -> np.ndarray:
        """Mark cubes by number as seen in `seen` (m, total) by their observers; return how many are new to each."""
        flat = observer * self.total + cell[0]
        view = seen.reshape(-1)
        new = np.unique(flat[~view[flat]])
        view[new] = True
        return np.bincount(new // self.total, minlength=len(seen))

    def columns(self) -> dict[int, np.ndarray]:
        """Return the numbers of the cubes of each column that has any, by the flat index of its cell of the plan."""
        order = np.argsort(self._flat, kind="stable")
        cells, first = np.unique(self._flat[order], return_index=True)
        return dict(zip(cells.tolist(), np.split(order, first[1:]), strict=True))

    def forget(self, seen: np.ndarray, low_m: np.ndarray, high_m: np.ndarray) -> None:
        """Clear what one observer has seen."""
        seen[:] = False

    def in_plan(self, cells: np.ndarray) -> np.ndarray:
        """Return over which columns (rows, cols) some cubes (total,) are."""
        found = np.zeros(self._columns, dtype=bool)
        found.reshape(-1)[self._flat[cells]] = True
        return found


def _column(world: World, places: np.ndarray, half_height_m: float) -> np.ndarray:
    """Return points (n, 3) m of the mine frame at which the robot's middle can be over places (k, 2) m of the plan."""
    height_m = float(world.record["height_m"])
    most = height_m + world.floor.lifts_at(places, height_m) - half_height_m - _CENTRE
    least = half_height_m + _CENTRE
    floors, offsets = world.floor.heights_at(places), world.floor.offsets_at(places)
    points = []
    for z in np.arange(least, most.max() + _STEP_M, _STEP_M).tolist():
        above = np.minimum(z, most)
        high = above >= least
        points.append(np.column_stack([places - offsets, floors + above])[high])
    return np.concatenate(points)


def _places(world: World, radius_m: float, centre_m: np.ndarray) -> np.ndarray:
    """Return the cells of the plan over which the robot can be, as a mask of the world's clearance."""
    standing = world.clearance_m >= radius_m
    found = _connected(world, standing, centre_m)
    joined = False
    while not joined:  # a shaft leads on to the workings at its other end
        joined = True
        row, col = np.nonzero(found)
        places = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
        for opening in _open(world, radius_m):
            near = [end is not None and _is_near(places, end) for end in _ends_of(world, opening)]
            beyond = _ends_of(world, opening)[0 if near[1] else 1]
            if any(near) and not all(near) and beyond is not None:
                found |= _connected(world, standing, beyond)
                joined = False
    return found


def _open(world: World, radius_m: float) -> list[dict[str, Any]]:
    """Return the openings of a world's record through which the robot fits and flies from one floor to that below."""
    openings = [o for o in world.record.get("openings", []) if o["sheet"] is not None]
    fenced = bool(world.record.get("fenced", True))
    return [o for o in openings if not has_fence(o, fenced) and _half_width(np.array(o["outline_m"])) >= radius_m]


def _half_width(outline: np.ndarray) -> float:
    """Return the distance (m) from the middle of a convex outline (n, 2) to the nearest of its edges."""
    along, to = np.roll(outline, -1, axis=0) - outline, outline.mean(axis=0) - outline
    across = np.abs(along[:, 0] * to[:, 1] - along[:, 1] * to[:, 0])
    return float((across / np.hypot(*along.T)).min())


def _ends_of(world: World, opening: dict[str, Any]) -> tuple[np.ndarray, np.ndarray | None]:
    """Return where a shaft begins and ends in the plan (2,) m: at its collar, and on the floor below it."""
    mouth = np.mean(np.array(opening["outline_m"]), axis=0)
    if opening["below"] is None:
        return mouth, None
    offsets = world.floor.offset_m
    return mouth, mouth - offsets[opening["sheet"]] + offsets[opening["below"]]


def _leads(world: World, places: np.ndarray, opening: dict[str, Any]) -> bool:
    """Return whether a shaft begins or ends at places (n, 2) m of the plan that can be reached."""
    return any(end is not None and _is_near(places, end) for end in _ends_of(world, opening))


def _is_near(places: np.ndarray, end: np.ndarray) -> bool:
    """Return whether one of the places (n, 2) m lies at an end (2,) m of a shaft."""
    return bool((np.abs(places - end) < _MOUTH_M).all(axis=1).any())


def _axis(world: World, opening: dict[str, Any]) -> np.ndarray:
    """Return points (n, 3) m of the mine frame on a shaft's axis."""
    x, y = np.mean(np.array(opening["outline_m"]), axis=0) - world.floor.offset_m[opening["sheet"]]
    z = np.arange(float(opening["bottom_m"]), float(opening["top_m"]), _SHAFT_STEP_M)
    return np.column_stack([np.full(len(z), x), np.full(len(z), y), z])
