"""Which floors and roofs are over and under places of a volume, by the planes of its facets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from minexplore.floors.volume_arrays import VolumeFacets, each_of
from minexplore.tiles import Tile, group_by_tile, tiles_at

_TILE_M = 2.0  # facets are looked up by square tiles seen from above
_PLUMB = 1e-6  # of a normal's length: a plumb facet is no floor and no roof
_SAME_M = 1e-4  # hits of one plumb line so near are on two facets that share an edge
_ON_EDGE = 1e-9  # of a facet's size: so far beyond its edge a place is still on it


@dataclass(frozen=True)
class ColumnHits:
    """Where plumb lines through places cross facets: the place's number, the height m, and the facet."""

    place: np.ndarray
    height_m: np.ndarray
    facet: np.ndarray


class FloorColumns:
    """The facets of a volume, looked up from above."""

    def __init__(self, facets: VolumeFacets) -> None:
        """Index the facets that are not plumb."""
        normal = facets.normals
        self.normals = normal
        self._level = np.flatnonzero(np.abs(normal[:, 2]) > _PLUMB * np.linalg.norm(normal, axis=1))
        corners = facets.vertices[facets.faces[self._level]]
        self._low, self._high = (side.T.copy() for side in (corners[..., :2].min(axis=1), corners[..., :2].max(axis=1)))
        self._corners, own = corners, normal[self._level]
        self._slope = -own[:, :2] / own[:, 2:]
        self.is_floor = normal[:, 2] < 0
        # Twice the area of each corner's part of the triangle is the product of an edge's normal and the place.
        a, b = np.roll(corners, -1, axis=1)[:, :, :2], np.roll(corners, -2, axis=1)[:, :, :2]
        turn = np.sign(own[:, 2])[:, None]
        self._edge = np.stack([a[..., 1] - b[..., 1], b[..., 0] - a[..., 0]], axis=2) * turn[..., None]
        self._start, self._size = a, np.abs(own[:, 2])
        self._near: dict[Tile, np.ndarray] = {}

    def _within(self, low_m: np.ndarray, high_m: np.ndarray) -> np.ndarray:
        return np.flatnonzero(((self._low <= high_m[:, None]) & (self._high >= low_m[:, None])).all(axis=0))

    def _about(self, tile: Tile) -> np.ndarray:
        if tile not in self._near:
            low = np.array(tile) * _TILE_M
            self._near[tile] = self._within(low, low + _TILE_M)
        return self._near[tile]

    def hits(self, places_m: np.ndarray) -> ColumnHits:
        """Return where plumb lines through places (n, 2) m cross facets."""
        found = [(np.zeros(0, int), np.zeros(0), np.zeros(0, int))]
        for tile, rows in group_by_tile(tiles_at(places_m, _TILE_M)) if len(places_m) else ():
            near = self._about(tile)
            place, facet = self._covered(places_m[rows][:, None], near)
            found.append((rows[place], self._height(places_m[rows[place]], near[facet]), self._level[near[facet]]))
        return ColumnHits(*(np.concatenate(column) for column in zip(*found, strict=True)))

    def _covered(self, places_m: np.ndarray, near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return which places (n, 1, 2) which of some facets (k,) cover."""
        inside = np.ones((len(places_m), len(near)), bool)
        slack = -_ON_EDGE * self._size[near]
        for k in range(3):
            away, edge = places_m - self._start[near, k], self._edge[near, k]
            inside &= away[..., 0] * edge[:, 0] + away[..., 1] * edge[:, 1] >= slack
        place, facet = np.nonzero(inside)
        return place, facet

    def _height(self, places_m: np.ndarray, facet: np.ndarray) -> np.ndarray:
        """Return the height (n,) m of the planes of facets (n,) at places (n, 2) m."""
        away, slope = places_m - self._corners[facet, 0, :2], self._slope[facet]
        found: np.ndarray = self._corners[facet, 0, 2] + away[:, 0] * slope[:, 0] + away[:, 1] * slope[:, 1]
        return found

    def grid_hits(self, first_m: np.ndarray, step_m: float, count: int) -> ColumnHits:
        """Return the hits of a square grid of so many places a side (row by row).

        A place on an edge of two facets belongs to one of them.
        """
        near = self._within(first_m, first_m + step_m * (count - 1))
        facet, row, col = _scan((self._corners[near][:, :, :2] - first_m) / step_m, count)
        places = first_m + step_m * np.column_stack([col, row])
        return ColumnHits(row * count + col, self._height(places, near[facet]), self._level[near[facet]])

    def spans(self, hits: ColumnHits, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return floors and roofs (n, k) m of the free spaces over and under so many places; NaN behind the last."""
        is_floor = self.is_floor[hits.facet]
        order = np.lexsort([hits.height_m, hits.place])
        place, z, is_floor = hits.place[order], hits.height_m[order], is_floor[order]
        again = np.append(False, (np.diff(place) == 0) & (np.diff(z) < _SAME_M) & (is_floor[1:] == is_floor[:-1]))
        place, z, is_floor = (a[~again[: len(a)]] for a in (place, z, is_floor))
        pairs = np.flatnonzero((place[1:] == place[:-1]) & is_floor[:-1] & ~is_floor[1:])
        owner = place[pairs]
        number = np.arange(len(owner)) - np.searchsorted(owner, owner)
        size = count, int(number.max(initial=0)) + 1
        low, high = np.full(size, np.nan), np.full(size, np.nan)
        low[owner, number], high[owner, number] = z[pairs], z[pairs + 1]
        return low, high

    def facets_under(self, places_m: np.ndarray) -> np.ndarray:
        """Return the facet (n,) of the first floor at or under places (n, 3) m, -1 where there is none."""
        hits = self.hits(places_m[:, :2])
        under = self.is_floor[hits.facet] & (hits.height_m <= places_m[hits.place, 2])
        place, height, facet = hits.place[under], hits.height_m[under], hits.facet[under]
        order = np.lexsort([facet, height, place])
        last = np.append(np.diff(place[order]) != 0, True)[: len(order)]
        found = np.full(len(places_m), -1)
        found[place[order][last]] = facet[order][last]
        return found

    def heights_on(self, facets: np.ndarray, places_m: np.ndarray) -> np.ndarray:
        """Return the heights (n,) m of facets (n,) that are not plumb at places (n, 2) m, NaN where a facet is -1."""
        at = np.searchsorted(self._level, np.maximum(facets, 0))
        return np.where(facets < 0, np.nan, self._height(places_m, np.minimum(at, len(self._level) - 1)))


def _scan(corners: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return triangle, row and column of the whole numbers below `count` that triangles (f, 3, 2) cover.

    Each row cuts two sides of a triangle, and the columns between are its own.
    """
    sides = []
    for k in range(3):
        a, b = corners[:, k], corners[:, (k + 1) % 3]
        swap = ((a[:, 1] > b[:, 1]) | ((a[:, 1] == b[:, 1]) & (a[:, 0] > b[:, 0])))[:, None]
        low, high = np.where(swap, b, a), np.where(swap, a, b)  # the same of both triangles beside a side
        begin, end = (np.clip(np.ceil(side[:, 1]), 0, count).astype(int) for side in (low, high))
        triangle, row = each_of(end - begin)
        row += begin[triangle]
        one, two = low[triangle], high[triangle]
        x = one[:, 0] + (row - one[:, 1]) / (two[:, 1] - one[:, 1]) * (two[:, 0] - one[:, 0])
        sides.append(np.column_stack([triangle, row, np.clip(np.ceil(x), 0, count).astype(int)]))
    each = np.concatenate(sides)
    each = each[np.lexsort((each[:, 2], each[:, 1], each[:, 0]))]
    left, right = each[0::2], each[1::2]
    owner, step = each_of(right[:, 2] - left[:, 2])
    return left[owner, 0], left[owner, 1], left[owner, 2] + step
