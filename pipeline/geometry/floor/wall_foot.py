"""The walls of a floor's mesh: its boundary, the band of rock round it, and the heights at the foot of its walls."""

from __future__ import annotations

import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.floors.floor import Floor

BAND_M = 1.0  # thickness of the rock round the workings
CORNER = 1.15  # of it at corners; the bands of walls of different heights, at least 2.3 m apart, do not meet
_SLOPE, _ALONG = 0.5, 0.05  # a wall that rises more than this over its distance is not the same wall
_EVERY_M = 0.25  # points along walls
_THIN_M, _STEP = 1.5, 0.2  # a pillar so thin between walls of which one is higher by more than this over its distance
FOOT_M = 0.05  # between the foot of a wall and the floor; walls reach SLAB_M below it


def band_of(free: BaseGeometry) -> BaseGeometry:
    """Return the workings and the band of rock round them."""
    # An outline of stage 2 carries the grid that it was rounded to, and would round the results to it.
    return shapely.set_precision(free, 0.0).buffer(BAND_M, join_style="mitre", mitre_limit=CORNER)


def outline_of(floor: Floor) -> BaseGeometry:
    """Return the workings with all corners that the mesh has on their boundary."""
    return polygon_of([Polygon(floor.vertices[ring, :2]) for ring in boundary_rings(floor)])


def polygon_of(rings: list[Polygon]) -> BaseGeometry:
    """Return the area inside counter-clockwise rings and outside clockwise ones."""
    outer = [ring for ring in rings if ring.exterior.is_ccw]
    inner = [ring for ring in rings if not ring.exterior.is_ccw]
    return shapely.union_all(outer).difference(shapely.union_all(inner))


def boundary_rings(floor: Floor) -> list[list[int]]:
    """Return the rings of the mesh's boundary; the floor lies on their left."""
    following = dict(boundary_edges(floor).tolist())
    rings = []
    while following:
        start = next(iter(following))
        ring = [start]
        while (successor := following.pop(ring[-1])) != start:
            ring.append(successor)
        rings.append(ring)
    return rings


def boundary_edges(floor: Floor) -> np.ndarray:
    """Return the mesh's boundary edges (k, 2); the floor lies on their left."""
    edges = np.concatenate([floor.faces[:, [0, 1]], floor.faces[:, [1, 2]], floor.faces[:, [2, 0]]])
    number = edges[:, 0].astype(np.int64) * len(floor.vertices) + edges[:, 1]
    turned = edges[:, 1].astype(np.int64) * len(floor.vertices) + edges[:, 0]
    return edges[~np.isin(number, turned)]


class WallFoot:
    """The floor's height along its boundary, and how much higher than `height_m` over it the roof is there."""

    def __init__(self, floor: Floor, rock: BaseGeometry | None = None, height_m: float = 0.0) -> None:
        """Take the boundary's edges, and for `ranges_at` the rock round the workings in plan."""
        edges = boundary_edges(floor)
        corners = np.column_stack([floor.vertices, floor.lifts_m(height_m)])
        self._a, self._b = corners[edges[:, 0]], corners[edges[:, 1]]
        lines = shapely.linestrings(np.stack([self._a[:, :2], self._b[:, :2]], axis=1))
        self._tree = shapely.STRtree(lines)
        middles = (self._a + self._b) / 2
        self._points = np.concatenate([self._a, middles])
        self._near = cKDTree(self._points[:, :2])
        self._rock = None if rock is None else rock.buffer(FOOT_M)
        self._dense = _along_edges(self._a, self._b)
        self._thin = None if rock is None else _near_other_heights(self._dense)

    def heights_at(self, places_m: np.ndarray) -> np.ndarray:
        """Return the floor's height (k,) m at the points of the boundary nearest to places (k, 2) m."""
        return self.levels_at(places_m)[0]

    def levels_at(self, places_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the floor's height and the roof's lift (k,) m at the points of the boundary nearest to places."""
        nearest = self._tree.nearest(shapely.points(places_m))
        a, b = self._a[nearest], self._b[nearest]
        along = b[:, :2] - a[:, :2]
        share = np.clip(((places_m - a[:, :2]) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        level, lift = (a[:, 2:] + share[:, None] * (b[:, 2:] - a[:, 2:])).T
        return level, lift

    def ranges_at(self, places_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the lowest floor and the highest roof, less the plan's height (k,) m, that rock is the wall of.

        Walls of different heights may be so near to each other that one piece of rock is the wall of both: from a place
        to either wall there is nothing but rock.
        """
        return self._ranges(places_m, self._points, self._near)

    def ranges_over(self, part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return `ranges_at` the corners (k, 2) m of a part of rock.

        In a thin pillar between walls of different heights, its edges too reach from one's floor to the other's roof.
        """
        low, high = self.ranges_at(part)
        assert self._thin is not None
        if not self._thin.n or not self._thin.query_ball_point(part, 2 * BAND_M, return_length=True).any():
            return low, high
        dense, least, most = cKDTree(self._dense[:, :2]), low.copy(), high.copy()
        for i in range(len(part)):
            j = (i + 1) % len(part)
            count = int(np.ceil(np.hypot(*(part[j] - part[i])) / _EVERY_M))
            share = np.linspace(0.0, 1.0, count + 1)
            floors, roofs = self._ranges(part[i] + share[:, None] * (part[j] - part[i]), self._dense, dense)
            under = (low[i] + share * (low[j] - low[i]) - floors).max()
            over = (roofs - high[i] - share * (high[j] - high[i])).max()
            for k in (i, j):
                if under > FOOT_M:  # both ends, as the edge is straight between them
                    least[k] = min(least[k], floors.min())
                if over > FOOT_M:
                    most[k] = max(most[k], roofs.max())
        return least, most

    def _ranges(self, places_m: np.ndarray, walls: np.ndarray, tree: cKDTree) -> tuple[np.ndarray, np.ndarray]:
        """Return `ranges_at` places, of points (n, 4) of walls."""
        low, lift = self.levels_at(places_m)
        high = low + lift
        for k, near in enumerate(tree.query_ball_point(places_m, 2 * BAND_M)):
            points = walls[near]
            tops = points[:, 2] + points[:, 3]
            rise = np.maximum(np.abs(points[:, 2] - low[k]), np.abs(tops - high[k]))
            other = points[rise > _ALONG + _SLOPE * np.hypot(*(points[:, :2] - places_m[k]).T)]
            ways = shapely.linestrings(np.stack([np.broadcast_to(places_m[k], (len(other), 2)), other[:, :2]], axis=1))
            seen = other[shapely.covers(self._rock, ways)] if len(other) else other
            if len(seen):
                low[k], high[k] = min(low[k], seen[:, 2].min()), max(high[k], (seen[:, 2] + seen[:, 3]).max())
        return low, high


def _along_edges(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the starts of edges from `a` to `b` (k, m), their middles, and points at most `_EVERY_M` apart."""
    steps = 2 * np.ceil(np.linalg.norm((b - a)[:, :2], axis=1) / (2 * _EVERY_M)).astype(int)
    edge = np.repeat(np.arange(len(a)), steps)
    share = (np.arange(len(edge)) - np.repeat(np.cumsum(steps) - steps, steps)) / steps[edge]
    return np.asarray(a[edge] + share[:, None] * (b - a)[edge])


def _near_other_heights(points: np.ndarray) -> cKDTree:
    """Return the places of those points (n, 4) of walls that have a wall of another height behind a thin pillar."""
    one, two = cKDTree(points[:, :2]).query_pairs(_THIN_M, output_type="ndarray").T
    tops = points[:, 2] + points[:, 3]
    rise = np.maximum(np.abs(points[one, 2] - points[two, 2]), np.abs(tops[one] - tops[two]))
    other = rise > _ALONG + _STEP * np.hypot(*(points[one, :2] - points[two, :2]).T)
    return cKDTree(points[np.unique(np.concatenate([one[other], two[other]])), :2])
