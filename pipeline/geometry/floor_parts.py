"""Convex parts of a world with heights: wedges of floor and roof, and walls that follow both."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import SLAB_M
from minexplore.floor import Floor
from pipeline.geometry.partition import convex_partition, merge_convex
from pipeline.geometry.polyline import arc_length
from pipeline.types import Occupancy, Points3

BAND_M = 1.0  # thickness of the rock round the workings
_HAIR_M = 0.0005
_FOOT_M = 0.05  # between the foot of a wall and the floor; walls reach SLAB_M below it
_TURN, _STRAIGHT_M = 1e-6, 1e-4  # corners on a straight wall, and of a straight edge of a wedge
_PLANE_M = 0.002  # corners of a merged wedge lie so near to one plane
_SLIVER_M = 0.02  # a wedge that reaches so little into the next zone is not cut


def floor_patches(floor: Floor) -> list[Points3]:
    """Return convex patches (k, 3) m of the floor: faces, merged where they lie in one plane to 2 mm."""

    def is_plane(loop: Sequence[int]) -> bool:
        corners = floor.vertices[list(loop)]
        middle = corners.mean(axis=0)
        places = np.column_stack([corners[:, :2] - middle[:2], np.ones(len(corners))])
        fit, *_ = np.linalg.lstsq(places, corners[:, 2] - middle[2], rcond=None)
        return bool(np.abs(places @ fit - (corners[:, 2] - middle[2])).max() <= _PLANE_M)

    patches: list[Points3] = []
    for sheet in range(len(floor.offset_m)):
        faces = floor.faces[floor.sheet == sheet]
        loops = merge_convex(floor.vertices[:, :2], faces.tolist(), is_plane)
        patches += [_corners(floor.vertices[loop]) for loop in loops]
    return patches


def _corners(loop: Points3) -> Points3:
    """Return a convex loop without corners that lie on the line between their neighbours.

    MuJoCo's search over a hull with nearly collinear corners can stop short and miss a contact.
    """
    kept = list(range(len(loop)))
    for k in range(len(loop)):
        at = kept.index(k)
        (ax, ay), (x, y), (bx, by) = (loop[kept[(at + step) % len(kept)], :2] for step in (-1, 0, 1))
        length = max(float(np.hypot(bx - ax, by - ay)), 1e-12)
        if len(kept) > 3 and abs((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / length < _STRAIGHT_M:
            kept.pop(at)
    return loop[kept]


def cut_by_zones(patches: list[Points3], edges_m: list[float]) -> list[tuple[int, Points3]]:
    """Return the patches cut along eastings, each with the number of its zone from the west."""
    found = []
    for patch in patches:
        west, east = patch[:, 0].min(), patch[:, 0].max()
        crossed = [(k, x) for k, x in enumerate(edges_m) if west + _SLIVER_M < x < east - _SLIVER_M]
        rest = patch
        for zone, x in crossed:
            found.append((zone, _clip(rest, x, -1.0)))
            rest = _clip(rest, x, 1.0)
        found.append((int(np.searchsorted(edges_m, rest[:, 0].mean())), rest))
    return found


def _clip(loop: Points3, east_m: float, side: float) -> Points3:
    """Return the part of a convex loop on one side of an easting: 1 east of it, -1 west."""
    ahead = side * (loop[:, 0] - east_m)
    kept = []
    for i in range(len(loop)):
        j = (i + 1) % len(loop)
        if ahead[i] >= 0:
            kept.append(loop[i])
        if (ahead[i] > 0) != (ahead[j] > 0) and ahead[i] != ahead[j]:
            kept.append(loop[i] + ahead[i] / (ahead[i] - ahead[j]) * (loop[j] - loop[i]))
    return np.array(kept)


def fold_patch(floor: Floor, patch: Points3) -> Points3:
    """Return a patch of one sheet, whose corners have their heights already, in the mine frame."""
    return patch - [*floor.offsets_at(patch[:, :2].mean(axis=0)[None])[0], 0.0]


def slab(top: Points3, low_m: float, high_m: float) -> Points3:
    """Return the corners of the slab between two distances above a patch."""
    return np.vstack([top + [0.0, 0.0, low_m], top + [0.0, 0.0, high_m]])


def band_of(free: BaseGeometry) -> BaseGeometry:
    """Return the workings and the band of rock round them."""
    # An outline of stage 2 carries the grid that it was rounded to, and would round the results to it.
    return shapely.set_precision(free, 0.0).buffer(BAND_M, join_style="mitre", mitre_limit=2.0)


def wall_parts(free: Polygon, floor: Floor, height_m: float) -> list[Points3]:
    """Return the convex parts (k, 3) m of the rock round the workings, from below the floor to above the roof.

    The corners of the floor's mesh on a wall are corners of the parts, so that a part's foot follows the floor exactly. The
    rock is cut across where the floor's slope along a wall changes, so that a part's back follows it too.
    """
    outline, cuts = _wall_lines(floor)
    rock = band_of(free).difference(outline)
    lines = shapely.union_all([rock.boundary, *([shapely.multilinestrings(cuts)] if len(cuts) else [])])
    pieces = [piece for piece in shapely.polygonize([lines]).geoms if rock.contains(piece.representative_point())]
    foot = WallFoot(floor)
    parts = []
    for piece in pieces:
        for part in (part for part in convex_partition(piece) if _is_solid(part)):
            parts.append(slab(np.column_stack([part, foot.heights_at(part)]), -SLAB_M, height_m + SLAB_M))
    return parts


def _is_solid(part: np.ndarray) -> bool:
    """Return whether a convex polygon (k, 2) m is wider than a hair; cuts near corners leave slivers."""
    return bool(np.linalg.eigvalsh(np.cov(part.T, bias=True))[0] > _HAIR_M**2)


def _wall_lines(floor: Floor) -> tuple[BaseGeometry, np.ndarray]:
    """Return the workings with the corners that their walls need, and lines (k, 2, 2) m that cut the rock behind them.

    A wall needs its corners in plan, and so many more that its foot lies within `_FOOT_M` of the floor's mesh.
    """
    rings, cuts = [], []
    for ring in boundary_rings(floor):
        corners = floor.vertices[ring]
        along = np.roll(corners, -1, axis=0)[:, :2] - corners[:, :2]
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
        before = np.roll(along, 1, axis=0)
        turns = np.abs(before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0]) > _TURN
        turns |= (before * along).sum(axis=1) < 0
        order = np.roll(np.arange(len(ring)), -int(turns.argmax()))
        kept = []
        for run in np.split(order, np.flatnonzero(turns[order])[1:]):
            closed = np.append(run, order[(np.flatnonzero(order == run[-1])[0] + 1) % len(order)])
            own = _bends(np.column_stack([arc_length(corners[closed, :2]), corners[closed, 2]]))
            kept += run[own[:-1]].tolist()
            for k in run[own[1:-1]].tolist():
                normal = np.array([along[k, 1], -along[k, 0]])
                cuts.append([corners[k, :2], corners[k, :2] + 2 * BAND_M * normal])
        rings.append(Polygon(corners[kept, :2]))
    return polygon_of(rings), np.array(cuts).reshape(-1, 2, 2)


def _bends(profile: np.ndarray) -> np.ndarray:
    """Return the numbers of the points of a profile (k, 2) m that keep the line through them near to all points."""
    kept = [0, len(profile) - 1]
    todo = [(0, len(profile) - 1)]
    while todo:
        a, b = todo.pop()
        line = np.interp(profile[a : b + 1, 0], profile[[a, b], 0], profile[[a, b], 1])
        off = np.abs(profile[a : b + 1, 1] - line)
        if off.max() > _FOOT_M:
            middle = a + int(off.argmax())
            kept.append(middle)
            todo += [(a, middle), (middle, b)]
    return np.array(sorted(kept))


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
    """The floor's height along its boundary."""

    def __init__(self, floor: Floor) -> None:
        """Take the boundary's edges."""
        edges = boundary_edges(floor)
        self._a, self._b = floor.vertices[edges[:, 0]], floor.vertices[edges[:, 1]]
        self._tree = shapely.STRtree(shapely.linestrings(np.stack([self._a[:, :2], self._b[:, :2]], axis=1)))

    def heights_at(self, places_m: np.ndarray) -> np.ndarray:
        """Return the height (k,) m at the points of the boundary nearest to places (k, 2) m."""
        nearest = self._tree.nearest(shapely.points(places_m))
        a, b = self._a[nearest], self._b[nearest]
        along = b[:, :2] - a[:, :2]
        share = np.clip(((places_m - a[:, :2]) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        return np.asarray(a[:, 2] + share * (b[:, 2] - a[:, 2]))


def cell_heights(grid: Occupancy, floor: Floor) -> np.ndarray | None:
    """Return the floor's height (rows, cols) m at the centre of each free cell, zero elsewhere; None on a flat floor."""
    if floor.is_flat:
        return None
    row, col = np.nonzero(grid.free)
    heights = np.zeros(grid.free.shape)
    heights[row, col] = floor.heights_at(grid.origin_m + (np.column_stack([col, row]) + 0.5) * grid.cell_m)
    return heights
