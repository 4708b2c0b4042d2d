"""Fold surfaces that reach beyond the floor: rock behind the walls takes the height of the wall's foot nearest to it.

`Floor.fold` is exact over the floor and near enough beside it for places. A surface must not have a step there, so that
here the height beside the floor is that of the nearest point of its boundary.
"""

from __future__ import annotations

import numpy as np

from minexplore.floor import Floor
from minexplore.tiles import group_by_tile, tiles_at

_TILE_M = 4.0
_NEAR_M = 2.0  # edges so far beyond a tile are tried first
_ON_M = 1e-9  # a share of a face's size
_PAIRS = 1_000_000  # of a place and an edge, at once


class Folding:
    """Heights over and beside a floor, and surfaces folded by them."""

    def __init__(self, floor: Floor) -> None:
        """Take the edges of the floor's boundary, sheet by sheet."""
        self.floor = floor
        edges = np.concatenate([floor.faces[:, [0, 1]], floor.faces[:, [1, 2]], floor.faces[:, [2, 0]]])
        number, turned = (edges[:, k].astype(np.int64) * len(floor.vertices) + edges[:, 1 - k] for k in (0, 1))
        rim = floor.vertices[edges[~np.isin(number, turned)]]
        self._start, self._along = rim[:, 0], rim[:, 1] - rim[:, 0]
        self._low, self._high = rim[:, :, :2].min(axis=1), rim[:, :, :2].max(axis=1)

    def heights_at(self, places_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the floor's height (k,) m at places (k, 2) m of the plan, and how far (k,) m they are beside it."""
        heights, beside = np.zeros(len(places_m)), np.zeros(len(places_m))
        if self.floor.is_flat or not len(places_m):
            return heights, beside
        faces = self.floor.faces_at(places_m)
        over = self.floor._covers(faces, places_m, _ON_M)
        a, b, c = self.floor.planes[faces[over]].T
        heights[over] = a * places_m[over, 0] + b * places_m[over, 1] + c
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
        """Return the height at, and the distance to, the nearest point of edges."""
        start, along = self._start[edges], self._along[edges]
        apart = places[:, None] - start[None, :, :2]
        share = np.clip((apart * along[:, :2]).sum(axis=2) / (along[:, :2] ** 2).sum(axis=1), 0.0, 1.0)
        away = np.linalg.norm(apart - share[:, :, None] * along[None, :, :2], axis=2)
        best = away.argmin(axis=1)
        rows = np.arange(len(places))
        return start[best, 2] + share[rows, best] * along[best, 2], away[rows, best]

    def fold(self, points_m: np.ndarray) -> np.ndarray:
        """Return points (k, 3) m of the plan, z from the floor, in the mine frame."""
        if self.floor.is_flat:
            return points_m
        places = points_m[:, :2]
        return np.column_stack([places - self.floor.offsets_at(places), points_m[:, 2] + self.heights_at(places)[0]])

    def unfold(self, points_m: np.ndarray, height_m: float) -> np.ndarray:
        """Return the points (k, 3) m of one surface, which belongs to one sheet, in the plan.

        It is the sheet over whose floor most of the points lie, between it and a roof `height_m` above.
        """
        floor = self.floor
        if floor.is_flat:
            return points_m
        best, least = points_m, np.inf
        for sheet, offset in enumerate(floor.offset_m):
            low, high = floor.spans_m[sheet]
            z = points_m[:, 2]
            if z.max() < low - height_m or z.min() > high + 2 * height_m:
                continue
            places = points_m[:, :2] + offset
            own = floor.sheets_at(places) == sheet
            heights, beside = self.heights_at(places)
            above = z - heights
            miss = beside + np.maximum(0.0, -above) + np.maximum(0.0, above - height_m) + np.where(own, 0.0, height_m)
            if miss.mean() < least:
                best, least = np.column_stack([places, above]), float(miss.mean())
        return best
