"""A constrained Delaunay triangulation of a polygon into which points are inserted."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from itertools import product
from math import floor

import numpy as np
from shapely.geometry.base import BaseGeometry

from pipeline.geometry.rock.partition import triangulate

Edge = tuple[int, int]
Face = tuple[int, int, int]
Tile = tuple[int, int]
_MOST_STEPS = 200  # of a walk to a point
_MERGED_M = 1e-3  # a point that falls so near to a corner of the boundary is that corner
_TILE_M, _MOST_RINGS = 8.0, 8  # faces are looked up by square tiles, so far around a place


class Triangulation:
    """Triangles of a polygon; the polygon's edges stay edges, or chains of edges after points were inserted on them.

    `opposite[a, b]` is the third corner of the counter-clockwise triangle with the edge from a to b.
    """

    def __init__(self, polygon: BaseGeometry) -> None:
        """Triangulate a polygon or multipolygon without further points."""
        points, faces = triangulate(polygon)
        self.xy: list[tuple[float, float]] = [(float(x), float(y)) for x, y in points]
        self.opposite: dict[Edge, int] = {}
        self._in_tile: defaultdict[Tile, set[Face]] = defaultdict(set)
        for a, b, c in faces.tolist():
            self._add(a, b, c)
        self._last: Edge = next(iter(self.opposite))
        for edge in list(self.opposite):
            self._legalize([edge])

    def insert(self, place: tuple[float, float], near_m: float) -> int:
        """Insert a point and return its number; a corner nearer than `near_m` is returned instead.

        A point within `near_m` of an edge on the boundary, or outside the polygon, is put on the boundary.
        """
        a, b, c = self._locate(place)
        nearest = min((a, b, c), key=lambda k: self._apart(k, place))
        if self._apart(nearest, place) < near_m:
            return nearest
        for u, v in ((a, b), (b, c), (c, a)):
            on_wall = (v, u) not in self.opposite
            if self._beside(u, v, place) >= (near_m if on_wall else 1e-6):
                continue
            foot = self._foot(u, v, place) if on_wall else place
            corner = min((u, v), key=lambda k: self._apart(k, foot))
            return corner if self._apart(corner, foot) < _MERGED_M else self._split_edge(u, v, foot)
        number = self._new(place)
        self._remove(a, b, c)
        for u, v in ((a, b), (b, c), (c, a)):
            self._add(u, v, number)
        self._legalize([(a, b), (b, c), (c, a)])
        self._last = (a, b) if (a, b) in self.opposite else next(iter(self.opposite))
        return number

    def split_wall(self, edge: Edge, place: tuple[float, float]) -> int:
        """Insert a point that lies on an edge of the boundary, and return its number."""
        return self._split_edge(*edge, place)

    def boundary(self) -> list[Edge]:
        """Return the edges on the boundary; the polygon lies on their left."""
        return [(a, b) for a, b in self.opposite if (b, a) not in self.opposite]

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the points (n, 2) m and the faces (m, 3), counter-clockwise, in a fixed order."""
        faces = sorted((a, b, c) for (a, b), c in self.opposite.items() if a < b and a < c)
        return np.array(self.xy), np.array(faces, np.int32)

    # --- changes ------------------------------------------------------------------------------------------------------

    def _new(self, place: tuple[float, float]) -> int:
        self.xy.append((float(place[0]), float(place[1])))
        return len(self.xy) - 1

    def _add(self, a: int, b: int, c: int) -> None:
        self.opposite[a, b] = c
        self.opposite[b, c] = a
        self.opposite[c, a] = b
        for tile in self._tiles(a, b, c):
            self._in_tile[tile].add(_from_lowest(a, b, c))

    def _remove(self, a: int, b: int, c: int) -> None:
        for edge in ((a, b), (b, c), (c, a)):
            del self.opposite[edge]
        for tile in self._tiles(a, b, c):
            self._in_tile[tile].remove(_from_lowest(a, b, c))

    def _tiles(self, *corners: int) -> Iterator[Tile]:
        """Return the tiles that the box of some corners meets."""
        x, y = zip(*(self.xy[k] for k in corners), strict=True)
        columns, rows = (range(floor(min(v) / _TILE_M), floor(max(v) / _TILE_M) + 1) for v in (x, y))
        return product(columns, rows)

    def _split_edge(self, u: int, v: int, place: tuple[float, float]) -> int:
        number, changed = self._new(place), []
        for a, b in ((u, v), (v, u)):
            c = self.opposite.get((a, b))
            if c is not None:
                self._remove(a, b, c)
                self._add(a, number, c)
                self._add(number, b, c)
                changed += [(c, a), (b, c)]
        self._legalize(list(changed))
        self._last = changed[0] if changed[0] in self.opposite else next(iter(self.opposite))
        return number

    def _legalize(self, edges: list[Edge]) -> None:
        """Flip edges until no corner lies in the circle of a neighbouring triangle."""
        while edges:
            u, v = edges.pop()
            c, d = self.opposite.get((u, v)), self.opposite.get((v, u))
            if c is None or d is None or not self._in_circle(u, v, c, d):
                continue
            self._remove(u, v, c)
            self._remove(v, u, d)
            self._add(u, d, c)
            self._add(d, v, c)
            edges += [(u, d), (d, v), (v, c), (c, u)]

    # --- places -------------------------------------------------------------------------------------------------------

    def _locate(self, place: tuple[float, float]) -> Face:
        """Return the triangle of a place, or the one nearest to it if it lies outside."""
        u, v = self._last
        for _ in range(_MOST_STEPS):
            w = self.opposite[u, v]
            out = [(a, b) for a, b in ((u, v), (v, w), (w, u)) if self._side(a, b, place) < -1e-12]
            if not out:
                return u, v, w
            out = [(a, b) for a, b in out if (b, a) in self.opposite]
            if not out:
                break
            a, b = out[0]
            u, v = b, a
        return self._nearest(place)

    def _nearest(self, place: tuple[float, float]) -> Face:
        column, row = (floor(v / _TILE_M) for v in place)
        here = sorted(self._in_tile.get((column, row), ()))
        if here:
            faces = np.array(here)
            corners = np.array([self.xy[k] for k in faces.ravel()]).reshape(-1, 3, 2) - place
            turned = np.roll(corners, -1, axis=1)
            length = np.linalg.norm(turned - corners, axis=2)
            beside = (corners[:, :, 0] * turned[:, :, 1] - corners[:, :, 1] * turned[:, :, 0]) / length
            inside = np.flatnonzero((beside >= -1e-12).all(axis=1))
            if len(inside):
                return here[int(inside[0])]
        for reach in range(1, _MOST_RINGS):
            around = product(range(column - reach, column + reach + 1), range(row - reach, row + reach + 1))
            near = {face for tile in around for face in self._in_tile.get(tile, ())}
            edges = {edge for a, b, c in near for edge in ((a, b), (b, c), (c, a)) if edge[::-1] not in self.opposite}
            best = min(((self._reach(*edge, place), edge) for edge in edges), default=None)
            if best and best[0] <= reach * _TILE_M:  # no edge beyond these tiles is nearer
                return *best[1], self.opposite[best[1]]
        _, (u, v) = min((self._reach(*edge, place), edge) for edge in self.boundary())
        return u, v, self.opposite[u, v]

    def _side(self, a: int, b: int, place: tuple[float, float]) -> float:
        (ax, ay), (bx, by), (x, y) = self.xy[a], self.xy[b], place
        return (bx - ax) * (y - ay) - (by - ay) * (x - ax)

    def _apart(self, k: int, place: tuple[float, float]) -> float:
        return float(np.hypot(self.xy[k][0] - place[0], self.xy[k][1] - place[1]))

    def _beside(self, u: int, v: int, place: tuple[float, float]) -> float:
        """Return the signed distance of a place to the left of an edge's line, m."""
        return self._side(u, v, place) / max(self._apart(u, self.xy[v]), 1e-12)

    def _foot(self, u: int, v: int, place: tuple[float, float]) -> tuple[float, float]:
        (ax, ay), (bx, by) = self.xy[u], self.xy[v]
        share = ((place[0] - ax) * (bx - ax) + (place[1] - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2)
        share = min(max(share, 1e-6), 1 - 1e-6)
        return ax + share * (bx - ax), ay + share * (by - ay)

    def _reach(self, u: int, v: int, place: tuple[float, float]) -> float:
        """Return the distance of a place from an edge, m."""
        (ax, ay), (bx, by) = self.xy[u], self.xy[v]
        share = ((place[0] - ax) * (bx - ax) + (place[1] - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2)
        share = min(max(share, 0.0), 1.0)
        return float(np.hypot(ax + share * (bx - ax) - place[0], ay + share * (by - ay) - place[1]))

    def _in_circle(self, u: int, v: int, c: int, d: int) -> bool:
        (x, y) = self.xy[d]
        rows = [(px - x, py - y) for px, py in (self.xy[u], self.xy[v], self.xy[c])]
        (ax, ay), (bx, by), (cx, cy) = rows
        a2, b2, c2 = ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy
        det = ax * (by * c2 - b2 * cy) - ay * (bx * c2 - b2 * cx) + a2 * (bx * cy - by * cx)
        if det <= 1e-9 * max(a2, b2, c2) ** 2:
            return False
        # Both new triangles must be counter-clockwise by more than rounding.
        return self._side(u, d, self.xy[c]) > 1e-9 and self._side(d, v, self.xy[c]) > 1e-9


def _from_lowest(a: int, b: int, c: int) -> Face:
    """Return the corners of a face in their order, the lowest number first."""
    return (a, b, c) if a < b and a < c else (b, c, a) if b < c else (c, a, b)
