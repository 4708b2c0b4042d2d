"""Convex parts of a world with heights: wedges of floor and roof, and walls that follow both."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import SLAB_M
from minexplore.floor import Floor
from pipeline.errors import GeometryError
from pipeline.geometry.partition import convex_partition, merge_convex
from pipeline.geometry.polyline import arc_length
from pipeline.types import Occupancy, Points3

BAND_M = 1.0  # thickness of the rock round the workings
_SLOPE, _ALONG = 0.5, 0.05  # a wall that rises more than this over its distance is not the same wall
_OVERLAP_M2 = 1e-3
_ONE_FLOOR_M = 0.3  # floors of two sheets that differ less are one, at their seam
_SAME_M = 1e-6
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


def _corners(loop: np.ndarray) -> np.ndarray:
    """Return a convex loop without corners on the line between their neighbours.

    MuJoCo's search over a hull with corners that nearly coincide or lie on a line can stop short: it misses a contact,
    or finds a place in the hull to be some centimetres outside.

    Parameters
    ----------
    loop : (k, 2 + m) m
        Places in plan, and m heights at each, which must lie on the line too, to `_FOOT_M`.
    """
    kept = list(range(len(loop)))
    for k in range(len(loop)):
        at = kept.index(k)
        before, after = (loop[kept[(at + step) % len(kept)]] for step in (-1, 1))
        along, step = after - before, loop[k] - before
        length = max(float(np.hypot(along[0], along[1])), 1e-12)
        off = abs(along[0] * step[1] - along[1] * step[0]) / length
        share = float(along[:2] @ step[:2]) / length**2
        level = np.abs(step[2:] - share * along[2:]).max(initial=0.0) <= _FOOT_M
        if len(kept) > 3 and off < _STRAIGHT_M and level:
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
    return np.vstack([top + np.array([0.0, 0.0, z]) for z in (low_m, high_m)])


def band_of(free: BaseGeometry) -> BaseGeometry:
    """Return the workings and the band of rock round them."""
    # An outline of stage 2 carries the grid that it was rounded to, and would round the results to it.
    return shapely.set_precision(free, 0.0).buffer(BAND_M, join_style="mitre", mitre_limit=2.0)


def wall_parts(free: Polygon, floor: Floor, height_m: float) -> list[Points3]:
    """Return the convex parts (k, 3) m of the rock round the workings, from below the floor to above the roof.

    The rock is cut across where the floor's slope along a wall changes, so that every part follows the floor.
    """
    outline, cuts = _wall_lines(floor)
    rock = band_of(free).difference(shapely.union_all([outline, *beside_sheets(floor, height_m)]))
    # Corners of two sheets at one place differ by rounding; the partition must not see an edge between them.
    rock = shapely.set_precision(shapely.set_precision(rock, _SAME_M), 0.0)
    lines = shapely.union_all([rock.boundary, *([shapely.multilinestrings(cuts)] if len(cuts) else [])])
    pieces = [piece for piece in shapely.polygonize([lines]).geoms if rock.contains(piece.representative_point())]
    foot = WallFoot(floor)
    parts = []
    for piece in pieces:
        for part in (part for part in convex_partition(piece) if _is_solid(part)):
            corners = _corners(np.column_stack([part, *foot.ranges_at(part)]))
            feet, tops = (fold_patch(floor, corners[:, [0, 1, z]]) for z in (2, 3))
            lowest, highest = np.array([0.0, 0.0, -SLAB_M]), np.array([0.0, 0.0, height_m + SLAB_M])
            parts.append(np.vstack([feet + lowest, tops + highest]))
    return parts


def beside_sheets(floor: Floor, height_m: float) -> list[BaseGeometry]:
    """Return floor of other sheets at about the same height beside each sheet, in its plan: no rock may stand there."""
    if len(floor.offset_m) == 1:
        return []
    foot, reach = WallFoot(floor), height_m + 2 * SLAB_M
    found = []
    for sheet, offset in enumerate(floor.offset_m):
        own = shapely.union_all(shapely.polygons(floor.vertices[floor.faces[floor.sheet == sheet], :2]))
        around = own.buffer(BAND_M)
        others = floor.sheet != sheet
        corners = floor.vertices[floor.faces[others]].copy()
        corners[:, :, :2] += (offset - floor.offset_m[floor.sheet[others]])[:, None]
        triangles = shapely.polygons(corners[:, :, :2])
        near = np.flatnonzero(shapely.intersects(around, triangles))
        if not len(near):
            continue
        level = foot.heights_at(corners[near, :, :2].mean(axis=1))
        z = corners[near, :, 2]
        same = (z.min(axis=1) < level + reach) & (z.max(axis=1) > level - reach)
        found += triangles[near[same]].tolist()
    return found


def require_pillars(floor: Floor, height_m: float) -> None:
    """Refuse sheets that pass over each other with less than `2 * SLAB_M` of rock between.

    Raises
    ------
    GeometryError
        With the place and the thickness.
    """
    if len(floor.offset_m) == 1:
        return
    corners = floor.vertices[floor.faces].copy()
    corners[:, :, :2] -= floor.offset_m[floor.sheet][:, None]
    triangles = shapely.polygons(corners[:, :, :2])
    one, two = shapely.STRtree(triangles).query(triangles, predicate="overlaps")
    pairs = (one < two) & (floor.sheet[one] != floor.sheet[two])
    one, two = one[pairs], two[pairs]
    common = shapely.intersection(triangles[one], triangles[two])
    large = shapely.area(common) > _OVERLAP_M2
    places = shapely.get_coordinates(shapely.point_on_surface(common[large]))
    heights = []
    for faces in (one[large], two[large]):
        a, b, c = floor.planes[faces].T
        moved = places + floor.offset_m[floor.sheet[faces]]
        heights.append(a * moved[:, 0] + b * moved[:, 1] + c)
    apart = np.abs(np.subtract(*heights)) if len(places) else np.zeros(0)
    pillar = apart - height_m
    thin = np.flatnonzero((apart > _ONE_FLOOR_M) & (pillar < 2 * SLAB_M))
    if len(thin):
        k = int(thin[pillar[thin].argmin()])
        (x, y), low = places[k], min(heights[0][k], heights[1][k])
        raise GeometryError(
            f"pillar: workings {apart[k]:.2f} m above others at ({x:.1f}, {y:.1f}), {low:.1f} m high, leave "
            f"{pillar[k]:.2f} m of rock over a roof {height_m:g} m high, want {2 * SLAB_M:g} m; a lower "
            "compile3d.height_m leaves more"
        )


def wall_lines(free: BaseGeometry, floor: Floor) -> BaseGeometry:
    """Return the walls in plan; the seams between sheets are none."""
    walls = sheet_walls(floor)
    return free.boundary if walls is None else shapely.multilinestrings(walls)


def sheet_walls(floor: Floor) -> np.ndarray | None:
    """Return the walls (k, 2, 2) m in plan of a mine of several sheets, None of one whose boundary is all wall."""
    return None if len(floor.offset_m) == 1 else floor.wall_segments()


def cell_offsets(grid: Occupancy, floor: Floor) -> np.ndarray:
    """Return how many cells (rows, cols, 2) the sheets of free cells are moved east and north."""
    offsets = np.zeros((*grid.free.shape, 2), dtype=np.int64)
    if len(floor.offset_m) > 1:
        row, col = np.nonzero(grid.free)
        places = grid.origin_m + (np.column_stack([col, row]) + 0.5) * grid.cell_m
        offsets[row, col] = np.round(floor.offsets_at(places) / grid.cell_m)
    return offsets


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
        lines = shapely.linestrings(np.stack([self._a[:, :2], self._b[:, :2]], axis=1))
        self._tree = shapely.STRtree(lines)
        middles = (self._a + self._b) / 2
        self._points = np.concatenate([self._a, middles])
        self._near = cKDTree(self._points[:, :2])

    def heights_at(self, places_m: np.ndarray) -> np.ndarray:
        """Return the height (k,) m at the points of the boundary nearest to places (k, 2) m."""
        nearest = self._tree.nearest(shapely.points(places_m))
        a, b = self._a[nearest], self._b[nearest]
        along = b[:, :2] - a[:, :2]
        share = np.clip(((places_m - a[:, :2]) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        return np.asarray(a[:, 2] + share * (b[:, 2] - a[:, 2]))

    def ranges_at(self, places_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the lowest and the highest floor (k,) m that the rock at places (k, 2) m is the wall of.

        Walls of different heights may be so near to each other that one piece of rock is the wall of both.
        """
        low = self.heights_at(places_m)
        high = low.copy()
        for k, near in enumerate(self._near.query_ball_point(places_m, 2 * BAND_M)):
            points = self._points[near]
            rise = np.abs(points[:, 2] - low[k])
            other = points[rise > _ALONG + _SLOPE * np.hypot(*(points[:, :2] - places_m[k]).T), 2]
            if len(other):
                low[k], high[k] = min(low[k], other.min()), max(high[k], other.max())
        return low, high


def cell_heights(grid: Occupancy, floor: Floor) -> np.ndarray | None:
    """Return the floor's height (rows, cols) m at each free cell's centre, else zero; None on a flat floor."""
    if floor.is_flat:
        return None
    row, col = np.nonzero(grid.free)
    heights = np.zeros(grid.free.shape)
    heights[row, col] = floor.heights_at(grid.origin_m + (np.column_stack([col, row]) + 0.5) * grid.cell_m)
    return heights
