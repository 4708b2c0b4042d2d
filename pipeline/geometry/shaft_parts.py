"""Convex parts about openings: the walls of shafts, fences round their collars, and the roofs over and under them."""

from __future__ import annotations

import numpy as np
import shapely
from shapely import Polygon

from minexplore.bundle import SLAB_M
from minexplore.floor import Floor
from pipeline.geometry.floor_parts import floor_patches, fold_patch, is_solid, slab
from pipeline.geometry.openings import roof_round
from pipeline.types import Opening, Openings, Points2, Points3

FENCE_M, FENCE_HEIGHT_M = 0.1, 1.1  # thickness and height; a beam at a robot's mast ends on it
OVER_ROOF = -1  # in place of a sheet
_INSETS_M, _LEAST_SHOWN_M = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3), 0.4  # of what is seen of a raise

_SHOULDER_M = 1.0  # from a collar down to the outer edge of a shaft's walls


def section_of(opening: Opening, floor: Floor) -> Points2:
    """Return the corners (k, 2) m of a plumb shaft in the mine frame."""
    return np.array(opening.outline_m) - floor.offset_m[opening.plan_sheet]


def section_below(opening: Opening, floor: Floor) -> Points2 | None:
    """Return the corners (k, 2) m of a shaft in the plan of the sheet below it, or None if it ends blind."""
    return None if opening.below is None else section_of(opening, floor) + floor.offset_m[opening.below]


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
        inner = section_of(opening, floor)
        outer = moved_out(inner, SLAB_M)
        tops, ends = ends_of(opening, floor, height_m)
        shoulders = np.minimum(_SHOULDER_M, (tops - ends) / 2) if opening.sheet is not None else -SLAB_M
        feet = ends + SLAB_M if opening.below is not None else ends - SLAB_M
        for k in range(len(inner)):
            pair = [k, (k + 1) % len(inner)]
            columns = [(inner, tops), (inner, ends), (outer, tops - shoulders), (outer, feet)]
            parts.append(np.vstack([np.column_stack([xy[pair], z[pair]]) for xy, z in columns]))
        if opening.below is None:
            parts.append(np.vstack([np.column_stack([inner, z]) for z in (ends - SLAB_M, ends)]))
        elif opening.sheet is None:
            parts.append(np.vstack([np.column_stack([inner, z]) for z in (tops, tops + SLAB_M)]))
    return parts


def is_blind(opening: Opening) -> bool:
    """Return whether a shaft has a part of its own as floor or cap at one end."""
    return opening.below is None or opening.sheet is None


def fence_parts(openings: Openings, floor: Floor) -> list[Points3]:
    """Return the fences, one part an edge of a collar, in the mine frame; they stand within the openings."""
    parts = []
    for opening in openings.collars:
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

    It is `OVER_ROOF` for those of a raise.
    """
    shafts = [
        OVER_ROOF if o.sheet is None else o.sheet
        for o in openings.shafts
        for _ in range(len(o.outline_m) + is_blind(o))
    ]
    return shafts + ([o.plan_sheet for o in openings.collars for _ in o.outline_m] if fenced else [])


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
