"""Convex parts of a world with heights: wedges of floor and roof, and walls that follow both."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import SLAB_M
from minexplore.floors.floor import Floor
from minexplore.floors.stretch import raise_m
from pipeline.geometry.floor.sheet_rock import beside_sheets
from pipeline.geometry.floor.wall_foot import BAND_M, FOOT_M, WallFoot, band_of, boundary_rings, polygon_of
from pipeline.geometry.polyline import arc_length
from pipeline.geometry.rock.partition import convex_partition, merge_convex
from pipeline.types import NO_OPENINGS, Occupancy, Openings, Points3

_SAME_M = 1e-6
_HAIR_M = 0.0005
_TURN, _STRAIGHT_M = 1e-6, 5e-5  # corners on a straight wall, and of a straight edge of a wedge: half of four decimals
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
        Places in plan, and m heights at each, which must lie on the line too, to `FOOT_M`.
    """
    kept = list(range(len(loop)))
    for k in range(len(loop)):
        at = kept.index(k)
        before, after = (loop[kept[(at + step) % len(kept)]] for step in (-1, 1))
        along, step = after - before, loop[k] - before
        length = max(float(np.hypot(along[0], along[1])), 1e-12)
        off = abs(along[0] * step[1] - along[1] * step[0]) / length
        share = float(along[:2] @ step[:2]) / length**2
        level = np.abs(step[2:] - share * along[2:]).max(initial=0.0) <= FOOT_M
        if len(kept) > 3 and off < _STRAIGHT_M and level:
            kept.pop(at)
    return loop[kept]


def cut_by_zones(patches: list[Points3], edges_m: list[float]) -> list[tuple[int, Points3]]:
    """Return patches (k, 3) m, mine frame, cut along eastings, each with the number of its zone from the west."""
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


def wall_parts(free: Polygon, floor: Floor, height_m: float, openings: Openings = NO_OPENINGS) -> list[Points3]:
    """Return the convex parts (k, 3) m of the rock round the workings, from below the floor to above the roof.

    The rock is cut across where the floor's or the roof's slope along a wall changes, so that every part follows both.
    There is none in openings.
    """
    outline, cuts = _wall_lines(floor, height_m)
    rock = band_of(free).difference(shapely.union_all([outline, *beside_sheets(floor, height_m)]))
    if openings.shafts:
        holes = shapely.polygons([opening.outline_m for opening in openings.shafts])
        rock = rock.difference(shapely.union_all(shapely.buffer(holes, _HAIR_M, join_style="mitre")))
    # Corners of two sheets at one place differ by rounding; the partition must not see an edge between them.
    rock = shapely.set_precision(shapely.set_precision(rock, _SAME_M), 0.0)
    lines = shapely.union_all([rock.boundary, *([shapely.multilinestrings(cuts)] if len(cuts) else [])])
    pieces = [piece for piece in shapely.polygonize([lines]).geoms if rock.contains(piece.representative_point())]
    foot = WallFoot(floor, rock, height_m)
    parts = []
    for piece in pieces:
        for part in (part for part in convex_partition(piece) if is_solid(part)):
            corners = _corners(np.column_stack([part, *foot.ranges_over(part)]))
            feet, tops = (fold_patch(floor, corners[:, [0, 1, z]]) for z in (2, 3))
            lowest, highest = np.array([0.0, 0.0, -SLAB_M]), np.array([0.0, 0.0, height_m + SLAB_M])
            parts.append(np.vstack([feet + lowest, tops + highest]))
    return parts


def wall_lines(free: BaseGeometry, floor: Floor) -> BaseGeometry:
    """Return the walls in plan; the seams between sheets are none."""
    walls = sheet_walls(floor)
    return free.boundary if walls is None else shapely.line_merge(shapely.multilinestrings(walls))


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


def is_solid(part: np.ndarray) -> bool:
    """Return whether a convex polygon (k, 2) m is wider than a hair; cuts near corners leave slivers."""
    return bool(np.linalg.eigvalsh(np.cov(part.T, bias=True))[0] > _HAIR_M**2)


def _wall_lines(floor: Floor, height_m: float) -> tuple[BaseGeometry, np.ndarray]:
    """Return the workings with the corners that their walls need, and lines (k, 2, 2) m that cut the rock behind them.

    A wall needs its corners in plan, and so many more that foot and head lie within `FOOT_M` of floor and roof.
    """
    rings, cuts = [], []
    lifts = floor.lifts_m(height_m)[:, None] if floor.is_stretched else np.zeros((len(floor.vertices), 0))
    levels = np.column_stack([floor.vertices[:, 2:], floor.vertices[:, 2:] + lifts])
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
            own = _bends(np.column_stack([arc_length(corners[closed, :2]), levels[ring][closed]]))
            kept += run[own[:-1]].tolist()
            for k in run[own[1:-1]].tolist():
                normal = np.array([along[k, 1], -along[k, 0]])
                cuts.append([corners[k, :2], corners[k, :2] + 2 * BAND_M * normal])
        rings.append(Polygon(corners[kept, :2]))
    return polygon_of(rings), np.array(cuts).reshape(-1, 2, 2)


def _bends(profile: np.ndarray) -> np.ndarray:
    """Return the numbers of the points of profiles (k, 1 + m) m that keep the lines through them near to all points.

    The first column is the distance along all of them.
    """
    kept = [0, len(profile) - 1]
    todo = [(0, len(profile) - 1)]
    while todo:
        a, b = todo.pop()
        along, ends = profile[a : b + 1, 0], profile[[a, b]]
        lines = [np.interp(along, ends[:, 0], column) for column in ends.T[1:]]
        off = np.abs(profile[a : b + 1, 1:] - np.column_stack(lines)).max(axis=1)
        if off.max() > FOOT_M:
            middle = a + int(off.argmax())
            kept.append(middle)
            todo += [(a, middle), (middle, b)]
    return np.array(sorted(kept))


def cell_columns(grid: Occupancy, floor: Floor, height_m: float) -> tuple[float | np.ndarray, np.ndarray | None]:
    """Return how high the roof is over the floor at free cells' centres, and the floor's height (rows, cols) m there.

    Of other cells both are any. The first is one number if the roof has no heights of its own, the second is None on a
    flat floor.
    """
    if floor.is_flat:
        return height_m, None
    row, col = np.nonzero(grid.free)
    places = grid.origin_m + (np.column_stack([col, row]) + 0.5) * grid.cell_m
    heights = np.zeros(grid.free.shape)
    heights[row, col] = floor.heights_at(places)
    if not floor.is_stretched:
        return height_m, heights
    roofs = np.full(grid.free.shape, height_m)
    roofs[row, col] = raise_m(height_m, floor.stretch_at(places))
    return roofs, heights
