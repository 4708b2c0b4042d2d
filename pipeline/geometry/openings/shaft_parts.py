"""Convex parts about openings: the walls of shafts, fences round their collars, and the roofs over and under them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely
from shapely import Polygon

from minexplore.bundle import SLAB_M
from minexplore.floors.floor import Floor
from minexplore.floors.shaft_axis import aside_at
from pipeline.errors import GeometryError
from pipeline.geometry.floor.parts import floor_patches, fold_patch, is_solid, slab
from pipeline.geometry.openings.fit import UNDER_BEND_M, lower_aside_m, roof_round
from pipeline.types import Opening, Openings, Points2, Points3

FENCE_M, FENCE_HEIGHT_M = 0.1, 1.1  # thickness and height; a beam at a robot's mast ends on it
OVER_ROOF = -1  # in place of a sheet
_INSETS_M, _LEAST_SHOWN_M = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3), 0.4  # of what is seen of a raise

_SHOULDER_M = 1.0  # from a collar down to the outer edge of a shaft's walls


def section_of(opening: Opening, floor: Floor) -> Points2:
    """Return the corners (k, 2) m of a shaft in the mine frame, where it meets the drift that it leaves."""
    return np.array(opening.outline_m) - floor.offset_m[opening.plan_sheet]


def section_at(opening: Opening, floor: Floor, height_m: float) -> Points2:
    """Return the corners (k, 2) m of a shaft at a height, in the mine frame."""
    return np.asarray(section_of(opening, floor) + aside_at(opening.bends_m, height_m))


def section_below(opening: Opening, floor: Floor) -> Points2 | None:
    """Return the corners (k, 2) m of a shaft in the plan of the sheet below it, or None if it ends blind."""
    if opening.below is None:
        return None
    return np.asarray(section_of(opening, floor) + lower_aside_m(opening) + floor.offset_m[opening.below])


def sections_shown(opening: Opening, floor: Floor) -> list[Points2]:
    """Return the sections (k, 2) m, in the plan of the sheet below, that a hole in the visible roof may have.

    It is that of the shaft. That of a raise may be smaller, where rock of the drift's walls is in the way.
    """
    section = section_below(opening, floor)
    if section is None:
        return []
    if opening.sheet is not None:
        return [section]
    side = float(np.linalg.norm(np.roll(section, -1, axis=0) - section, axis=1).min())
    return [moved_out(section, -inset) for inset in _INSETS_M if inset == 0 or side - 2 * inset >= _LEAST_SHOWN_M]


def ends_of(opening: Opening, floor: Floor, height_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return how high each of a shaft's edges begins and ends (k,) m: at its collar, and at the roof or floor below.

    A raise begins at its cap, and ends where the roof is highest along its edges: nothing hangs out of an uneven roof.
    The roof is `height_m` over the floor below.
    """
    corners, below = np.array(opening.outline_m), section_below(opening, floor)
    if opening.sheet is None:
        roof_m, uneven_m = roof_round(opening, floor, height_m)
        return np.full(len(corners), opening.top_m), roof_m + uneven_m
    tops = floor.heights_at(corners)
    if below is None:
        return tops, np.full(len(corners), opening.bottom_m)
    return tops, floor.raised(height_m).heights_at(below)


def shaft_parts(openings: Openings, floor: Floor, height_m: float) -> list[Points3]:
    """Return the walls of each shaft in the mine frame, one an edge, and a floor or a cap of its own at a blind end.

    A wall's inner face reaches from the collar to the roof below. Its outer one ends lower, so that nothing but the
    collar's edge is near to a robot beside it, and in the slab of the roof. A raise's walls reach as high as its cap.
    """
    parts = []
    for opening in openings.shafts:
        if opening.bends_m:
            parts += _leaning_parts(opening, floor, height_m)
            continue
        inner = section_of(opening, floor)
        outer = moved_out(inner, SLAB_M)
        tops, ends = ends_of(opening, floor, height_m)
        shoulders = np.minimum(_SHOULDER_M, (tops - ends) / 2) if opening.sheet is not None else -SLAB_M
        feet = ends + SLAB_M if opening.below is not None else ends - SLAB_M
        for k in range(len(inner)):
            pair = [k, (k + 1) % len(inner)]
            columns = [(inner, tops), (inner, ends), (outer, tops - shoulders), (outer, feet)]
            parts.append(np.vstack([np.column_stack([xy[pair], z[pair]]) for xy, z in columns]))
        parts += _ends_parts(opening, inner, inner, tops, ends)
    return parts


def _ends_parts(opening: Opening, upper: Points2, lower: Points2, tops: np.ndarray, ends: np.ndarray) -> list[Points3]:
    """Return the floor of a shaft that ends blind, or the cap of a raise, at its upper or lower section (k, 2) m."""
    if opening.below is None:
        return [np.vstack([np.column_stack([lower, z]) for z in (ends - SLAB_M, ends)])]
    if opening.sheet is None:
        return [np.vstack([np.column_stack([upper, z]) for z in (tops, tops + SLAB_M)])]
    return []


def rows_of(opening: Opening, floor: Floor, height_m: float) -> list[tuple[Points2, np.ndarray]]:
    """Return the sections (k, 2) m of a leaning shaft in the mine frame from its top down, and their heights (k,) m.

    Between two sections its walls are straight.

    Raises
    ------
    GeometryError
        If the roof below is so high that no plumb end is left; with the place and the heights.
    """
    tops, ends = ends_of(opening, floor, height_m)
    inner = section_of(opening, floor)
    last = opening.bends_m[-1][2]
    if opening.below is not None and float(ends.max()) > last - UNDER_BEND_M:
        x, y = inner.mean(axis=0)
        raise GeometryError(
            f"the shaft at ({x:.1f}, {y:.1f}), which leans, meets a roof {ends.max():.2f} m high, want at most "
            f"{last - UNDER_BEND_M:.2f} m; a lower compile3d.height_m or contours.openings=false builds it"
        )
    rows = [(inner + aside[:2], np.full(len(inner), aside[2])) for aside in np.array(opening.bends_m)]
    rows[:1] = [(rows[0][0], tops), *(rows[:1] if opening.sheet is not None else [])]
    rows[-1:] = [*(rows[-1:] if opening.below is not None else []), (rows[-1][0], ends)]
    return rows


def _leaning_parts(opening: Opening, floor: Floor, height_m: float) -> list[Points3]:
    """Return the walls of a shaft that leans, one an edge between two bends, and its blind end.

    They are thicker aside, by as much as they lean, so that all are as thick as those of plumb shafts.
    """
    rows, parts = rows_of(opening, floor, height_m), []
    for number, ((upper, tops), (lower, ends)) in enumerate(pairwise(rows)):
        lean = np.linalg.norm((upper - lower)[0]) / float((tops - ends).min())
        outer = [moved_out(section, SLAB_M * float(np.hypot(1.0, lean))) for section in (upper, lower)]
        columns = [(upper, tops), (lower, ends), (outer[1], ends)]
        if opening.sheet is None or number > 0:  # at a collar nothing but its edge is near to a robot
            columns.append((outer[0], tops))
        if opening.sheet is None and number == 0:
            columns.append((outer[0], tops + SLAB_M))
        if number == len(rows) - 2:
            beyond = (outer[1], ends + (SLAB_M if opening.below is not None else -SLAB_M))
            columns[2:] = [beyond, *columns[3:]] if opening.below is not None else [*columns[2:], beyond]
        for k in range(len(upper)):
            pair = [k, (k + 1) % len(upper)]
            parts.append(np.vstack([np.column_stack([xy[pair], z[pair]]) for xy, z in columns]))
    return parts + _ends_parts(opening, rows[0][0], rows[-1][0], rows[0][1], rows[-1][1])


def is_blind(opening: Opening) -> bool:
    """Return whether a shaft has a part of its own as floor or cap at one end."""
    return opening.below is None or opening.sheet is None


def count_parts(opening: Opening) -> int:
    """Return how many parts a shaft has."""
    edges, bends = len(opening.outline_m), len(opening.bends_m)
    straight = bends - 1 + (opening.sheet is not None) + (opening.below is not None) if bends else 1
    return edges * straight + is_blind(opening)


def fence_parts(openings: Openings, floor: Floor, fenced: bool) -> list[Points3]:
    """Return the fences, one part an edge of a collar, in the mine frame; they stand within the openings.

    Without `fenced` only shafts that lean have one.
    """
    parts = []
    for opening in openings.fenced(fenced):
        outer = section_of(opening, floor)
        inner = moved_out(outer, -FENCE_M)
        foot = floor.heights_at(np.array(opening.outline_m))
        for k in range(len(outer)):
            pair = [k, (k + 1) % len(outer)]
            columns = [(xy, foot + z) for xy in (outer, inner) for z in (-SLAB_M, FENCE_HEIGHT_M)]
            parts.append(np.vstack([np.column_stack([xy[pair], z[pair]]) for xy, z in columns]))
    return parts


def sheets_of_parts(openings: Openings, fenced: bool) -> list[int]:
    """Return the sheet of the collar that each part of shafts and fences belongs to, in the order of the parts.

    It is `OVER_ROOF` for those of a raise, and of a shaft that leans, which lies under other places of the plan.
    """
    shafts = [
        OVER_ROOF if o.sheet is None or o.bends_m else o.sheet for o in openings.shafts for _ in range(count_parts(o))
    ]
    return shafts + [o.plan_sheet for o in openings.fenced(fenced) for _ in o.outline_m]


def roof_slabs(floor: Floor, height_m: float, openings: Openings) -> list[Points3]:
    """Return the convex wedges (k, 3) m of the roof, in the mine frame.

    There is roof over a collar too, and none where a shaft comes down.
    """
    under, low = (floor.raised(height_m), 0.0) if floor.is_stretched else (floor, height_m)
    patches = floor_patches(under)
    for opening in openings.collars:
        corners = np.array(opening.outline_m)
        patches.append(np.column_stack([corners, under.heights_at(corners)]))
    for opening in openings.shafts:
        hole = section_below(opening, floor)
        if hole is not None:
            patches = [piece for patch in patches for piece in _around(patch, hole)]
    return [slab(fold_patch(under, patch), low, low + SLAB_M) for patch in patches]


def moved_out(corners: Points2, far_m: float) -> Points2:
    """Return the corners (k, 2) m of a convex counter-clockwise outline with its edges moved outwards."""
    along = np.roll(corners, -1, axis=0) - corners
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    out = np.column_stack([along[:, 1], -along[:, 0]])
    before = np.roll(out, 1, axis=0)
    return np.asarray(corners + far_m * (out + before) / (1 + (out * before).sum(axis=1, keepdims=True)))


def _around(patch: Points3, hole: Points2) -> list[Points3]:
    """Return the convex pieces of a convex patch (k, 3) m outside a convex counter-clockwise hole (n, 2) m."""
    if not shapely.intersects(Polygon(patch[:, :2]), Polygon(hole)):
        return [patch]
    pieces, rest = [], patch
    for a, b in zip(hole, np.roll(hole, -1, axis=0), strict=True):
        outward = np.array([b[1] - a[1], a[0] - b[0]])
        ahead = (rest[:, :2] - a) @ outward
        pieces.append(_clip(rest, ahead))
        rest = _clip(rest, -ahead)
        if len(rest) < 3:
            break
    return [piece for piece in pieces if len(piece) > 2 and is_solid(piece[:, :2])]


def _clip(loop: Points3, ahead: np.ndarray) -> Points3:
    """Return the part of a convex loop where a linear function, `ahead` (k,) at its corners, is positive."""
    kept = []
    for i in range(len(loop)):
        j = (i + 1) % len(loop)
        if ahead[i] >= 0:
            kept.append(loop[i])
        if ahead[i] * ahead[j] < 0:
            kept.append(loop[i] + ahead[i] / (ahead[i] - ahead[j]) * (loop[j] - loop[i]))
    return np.array(kept).reshape(-1, 3)
