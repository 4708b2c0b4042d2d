"""Fold surfaces that reach beyond the floor: rock behind the walls takes the height of the wall's foot nearest to it.

`Floor.fold` is exact over the floor and near enough beside it for places. A surface must not have a step there, so that
here the height beside the floor is that of the nearest point of its boundary.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

import numpy as np

from minexplore.floors.floor import Floor
from minexplore.floors.stretch import lower_m, raise_m
from minexplore.tiles import group_by_tile, tiles_at

_TILE_M = 4.0
_NEAR_M = 2.0  # edges so far beyond a tile are tried first
_BEHIND_M = 1.0  # along the walls behind a seam
_FAR_M = 100.0  # what points count that are nowhere near a sheet
_ALIKE = 0.1  # walls farther by this share of the nearest one's distance count nothing
_BEYOND_M = 0.3  # of an edge's ends, that its slope goes on
_ON_M = 1e-9  # a share of a face's size
_PAIRS = 1_000_000  # of a place and an edge, at once


class Folding:
    """Heights over and beside a floor, and surfaces folded by them."""

    def __init__(self, floor: Floor) -> None:
        """Take the walls of each sheet, and near a seam those of the next sheet too."""
        self.floor = floor
        rim, self._is_own = _walls(floor)
        self._start, self._along = rim[:, 0], rim[:, 1] - rim[:, 0]
        self._low, self._high = rim[:, :, :2].min(axis=1), rim[:, :, :2].max(axis=1)

    def heights_at(self, places_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the floor's height (k,) m at places (k, 2) m of the plan, and how far (k,) m they are beside it.

        Behind a seam, the height is that of the next sheet's walls, but the distance is from the sheet itself.
        """
        values, beside = self._values_at(places_m)
        return values[:, 0], beside

    def stretch_at(self, places_m: np.ndarray) -> np.ndarray | None:
        """Return how much (k,) the plan is stretched upwards at places (k, 2) m, None if it is nowhere."""
        return self._values_at(places_m)[0][:, 1] if self.floor.is_stretched else None

    def _values_at(self, places_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the floor's height, and the stretch if it has one (k, 1 or 2), and the distance beside it (k,) m."""
        heights, beside = np.zeros((len(places_m), 1 + self.floor.is_stretched)), np.zeros(len(places_m))
        if self.floor.is_flat or not len(places_m):
            return heights, beside
        faces = self.floor.faces_at(places_m)
        over = self.floor._covers(faces, places_m, _ON_M)
        a, b, c = self.floor.planes[faces[over]].T
        heights[over, 0] = a * places_m[over, 0] + b * places_m[over, 1] + c
        if self.floor.is_stretched:
            heights[over, 1] = self.floor._stretch_on(faces[over], places_m[over])
        off = np.flatnonzero(~over)
        for tile, rows in group_by_tile(tiles_at(places_m[off], _TILE_M)):
            low = np.array(tile) * _TILE_M
            near = np.flatnonzero(((self._low <= low + _TILE_M + _NEAR_M) & (self._high >= low - _NEAR_M)).all(axis=1))
            if not len(near):
                near = np.arange(len(self._start))
            step = _PAIRS // len(near) + 1
            for first in range(0, len(rows), step):
                some = off[rows[first : first + step]]
                heights[some], beside[some] = self._nearest(places_m[some], near)
        return heights, beside

    def _nearest(self, places: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the values at the nearest point of edges, and the distance to the nearest one of the sheets' own.

        Of edges that are about as near, values are averaged: behind a corner, a surface would have a step otherwise.
        """
        start, along = self._start[edges], self._along[edges]
        apart = places[:, None] - start[None, :, :2]
        length = np.linalg.norm(along[:, :2], axis=1)
        share = (apart * along[:, :2]).sum(axis=2) / length**2
        away = np.linalg.norm(apart - np.clip(share, 0.0, 1.0)[:, :, None] * along[None, :, :2], axis=2)
        least = away.min(axis=1)
        weight = np.maximum(0.0, 1 - (away - least[:, None]) / (_ALIKE * least + _ON_M)[:, None])
        # A straight wall of several edges counts as one; hairs have any slope.
        reach = np.where(length > _BEYOND_M, _BEYOND_M / length, 0.0)
        share = np.clip(share, -reach, 1 + reach)
        values = [(weight * (a + share * b)).sum(axis=1) for a, b in zip(start.T[2:], along.T[2:], strict=True)]
        beside = away[:, self._is_own[edges]].min(axis=1, initial=_FAR_M)
        return np.column_stack(values) / weight.sum(axis=1)[:, None], beside

    def fold(self, points_m: np.ndarray) -> np.ndarray:
        """Return points (k, 3) m of the plan, z from the floor, in the mine frame."""
        if self.floor.is_flat:
            return points_m
        places, above = points_m[:, :2], points_m[:, 2]
        values = self._values_at(places)[0]
        if self.floor.is_stretched:
            above = raise_m(above, values[:, 1])
        return np.column_stack([places - self.floor.offsets_at(places), above + values[:, 0]])

    def unfold(self, points_m: np.ndarray, height_m: float) -> np.ndarray:
        """Return the points (k, 3) m of one surface, which belongs to one sheet, in the plan.

        It is the sheet over whose floor most of the points lie, between it and a roof `height_m` above.
        """
        if self.floor.is_flat:
            return points_m
        least, sheet = np.inf, 0
        for number in range(len(self.floor.offset_m)):
            miss = self._miss(points_m, number, height_m).mean()
            if miss < least:
                least, sheet = miss, number
        return self._in_sheet(points_m, sheet)

    def unfold_each(self, bodies_m: np.ndarray, height_m: float) -> np.ndarray:
        """Return bodies (n, k, 3) m, of k points each, in the plan of the sheet that the middle of each belongs to."""
        if self.floor.is_flat:
            return bodies_m
        middles = bodies_m.mean(axis=1)
        sheet = np.argmin([self._miss(middles, k, height_m) for k in range(len(self.floor.offset_m))], axis=0)
        placed = np.empty(bodies_m.shape)
        for number in np.unique(sheet).tolist():
            own = sheet == number
            placed[own] = self._in_sheet(bodies_m[own].reshape(-1, 3), number).reshape(-1, *bodies_m.shape[1:])
        return placed

    def _in_sheet(self, points_m: np.ndarray, sheet: int) -> np.ndarray:
        """Return points (k, 3) m in the plan of a sheet, z from the floor."""
        places = points_m[:, :2] + self.floor.offset_m[sheet]
        return np.column_stack([places, self.above(places, points_m[:, 2])[0]])

    def above(self, places_m: np.ndarray, z_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how high (k,) m points are in the plan, and how far (k,) m beside the floor."""
        values, beside = self._values_at(places_m)
        above = z_m - values[:, 0]
        return lower_m(above, values[:, 1]) if self.floor.is_stretched else above, beside

    def _miss(self, points_m: np.ndarray, sheet: int, height_m: float) -> np.ndarray:
        """Return how far (k,) m points are from the workings of a sheet: beside, below and above; far ones roughly."""
        low, high = self.floor.spans_m[sheet]
        most = height_m + max(0.0, self.floor.lifts_m(height_m).max())
        z = points_m[:, 2]
        miss = np.maximum(0.0, low - z) + np.maximum(0.0, z - high - most) + _FAR_M
        near = np.flatnonzero(miss < _FAR_M + height_m)
        places = points_m[near, :2] + self.floor.offset_m[sheet]
        own = self.floor.sheets_at(places) == sheet
        near, places = near[own], places[own]
        above, beside = self.above(places, z[near])
        miss[near] = beside + np.maximum(0.0, -above) + np.maximum(0.0, above - height_m)
        return miss


def _walls(floor: Floor) -> tuple[np.ndarray, np.ndarray]:
    """Return the feet of the walls (k, 2, 3) m in plan, seams, and walls behind them in the plan of the sheet before.

    A stretch is a fourth column. Two sheets then find the same foot for a place beside their seam. The second array
    (k,) states which are a sheet's own.
    """
    if floor.is_flat:
        return np.zeros((0, 2, 3)), np.zeros(0, bool)
    found = floor.wall_edges()
    corners = np.array([edge for _, edge in found])
    vertices = np.column_stack([floor.vertices, floor.stretch]) if floor.is_stretched else floor.vertices
    walls = vertices[corners]
    if len(floor.offset_m) == 1:
        return walls, np.ones(len(walls), bool)
    at_corner: dict[int, list[int]] = defaultdict(list)
    for number, (a, b) in enumerate(corners.tolist()):
        at_corner[a].append(number)
        at_corner[b].append(number)
    (edges, beyond), of = floor.edges, np.tile(floor.sheet, 3)
    own, behind = [walls], [walls[:0]]
    for k in np.flatnonzero((beyond >= 0) & (of[beyond] != of)).tolist():
        other = beyond[k]
        aside = np.zeros(vertices.shape[1])
        aside[:2] = floor.offset_m[of[k]] - floor.offset_m[of[other]]
        own.append(vertices[edges[k]][None])
        behind.append(_walls_from(edges[other].tolist(), walls, corners, at_corner) + aside)
    edge, first = np.unique(np.concatenate([*own, *behind]), axis=0, return_index=True)
    return edge, first < sum(map(len, own))


def _walls_from(
    ends: list[int], walls: np.ndarray, corners: np.ndarray, at_corner: Mapping[int, list[int]]
) -> np.ndarray:
    """Return the first metre of the walls (k, 2, 3) m that begin at the ends of a seam."""
    found = [np.zeros((0, *walls.shape[1:]))]
    for seam_end in ends:
        todo: list[tuple[int, float]] = [(seam_end, 0.0)]
        done: set[int] = set()
        while todo:
            corner, along = todo.pop()
            for number in set(at_corner.get(corner, [])) - done:
                done.add(number)
                ahead = corners[number, 0] == corner
                one, two = walls[number] if ahead else walls[number, ::-1]
                length = float(np.hypot(*(two - one)[:2]))
                found.append(np.array([[one, one + min(1.0, (_BEHIND_M - along) / length) * (two - one)]]))
                if along + length < _BEHIND_M:
                    todo.append((int(corners[number, int(ahead)]), along + length))
    return np.concatenate(found)
