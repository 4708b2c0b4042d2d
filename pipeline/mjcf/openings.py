"""What a camera sees of openings: the lining of each shaft, and the fence round its collar; neither collides.

They lie on the faces of the collision parts, so that beams and cameras meet what a robot would touch.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely

from minexplore.bundle import TriangleMesh, decode_msh, encode_msh, opening_mesh
from minexplore.floors.floor import Floor
from minexplore.floors.folding import Folding
from minexplore.floors.shaft_axis import aside_at
from pipeline.geometry.openings.fit import lower_aside_m
from pipeline.geometry.openings.shaft_parts import (
    FENCE_HEIGHT_M,
    FENCE_M,
    ends_of,
    moved_out,
    section_below,
    section_of,
    sections_shown,
)
from pipeline.geometry.raycast import RayCaster
from pipeline.store.codecs import Bundle
from pipeline.types import Opening, Openings

_STEP_M, _MOST_STEPS = 0.5, 100  # of a lining, downwards: MuJoCo lights vertices
_ACROSS_M, _INTO_M = 0.1, 0.03  # from place to place at which a lining ends at the rock, and so far below it
_EYE_M = 1.2  # over the floor below, from where the roof is looked for
_BESIDE_M = 0.02  # a shaft's section, where the roof is whole
_WITHIN_M = 0.04  # a hole in the roof, which may be smaller than the section by two centimetres
_DIGITS = 4


def show_openings(openings: Openings, floor: Floor, rough: Bundle, height_m: float, fenced: bool) -> Bundle:
    """Return the meshes of linings and fences by name as `.msh`, m, mine frame.

    Parameters
    ----------
    openings : Openings
    floor : Floor
        With faces over the openings.
    rough : dict of bytes
        The chunks of the visible rock as `.msh`: a lining ends where the roof below is.
    height_m : float
        From the floor to the roof.
    fenced : bool
        Whether there are fences; those of shafts that lean are always there.
    """
    rock = _rock_under(openings, floor, rough, height_m)
    found: Bundle = {}
    for number, opening in enumerate(openings.shafts):
        found[opening_mesh("shaft", number)] = encode_msh(_lining(opening, floor, rock, height_m))
        if Openings([opening]).fenced(fenced):
            found[opening_mesh("fence", number)] = encode_msh(_fence(opening, floor))
    return found


def _rock_under(openings: Openings, floor: Floor, rough: Bundle, height_m: float) -> RayCaster | None:
    """Return the visible rock of the sheets that shafts lead to, in the plan."""
    below = {opening.below for opening in openings.shafts} - {None}
    folding, placed = Folding(floor), [np.zeros((0, 3, 3))]
    for data in rough.values() if below else ():
        mesh = decode_msh(data)
        places = folding.unfold(mesh.vertices, height_m)
        if floor.sheets_at(places[:1, :2])[0] in below:
            placed.append(places[mesh.faces])
    triangles = np.concatenate(placed)
    return RayCaster(triangles) if len(triangles) else None


def _lining(opening: Opening, floor: Floor, rock: RayCaster | None, height_m: float) -> TriangleMesh:
    """Return the walls of a shaft, seen from inside, and the floor or the cap of a blind one."""
    corners, (tops, ends) = _shown(opening, floor, rock), ends_of(opening, floor, height_m)
    pieces = []
    for k, after in enumerate(np.roll(np.arange(len(corners)), -1)):
        count = max(2, int(np.ceil(np.linalg.norm(corners[after] - corners[k]) / _ACROSS_M)) + 1)
        share = np.linspace(0, 1, count)[:, None]
        places = corners[k] + share * (corners[after] - corners[k])
        top, end = (values[k] + share[:, 0] * (values[after] - values[k]) for values in (tops, ends))
        end = _roofs_at(opening, floor, rock, places, end)
        heights = _heights_down(opening, top, end, float(np.ptp([*tops, *ends])))
        x, y = np.moveaxis(places + aside_at(opening.bends_m, heights), -1, 0)
        pieces.append(_grid(np.dstack([x, y, heights])))
    if opening.below is None:
        bottom = np.column_stack([corners + lower_aside_m(opening), ends])
        pieces.append((bottom, np.array([(0, b, b + 1) for b in range(1, len(corners) - 1)])))
    elif opening.sheet is None:
        cap = np.column_stack([corners + aside_at(opening.bends_m, opening.top_m), tops])
        pieces.append((cap, np.array([(0, b + 1, b) for b in range(1, len(corners) - 1)])))
    return _joined(pieces)


def _heights_down(opening: Opening, top: np.ndarray, end: np.ndarray, deep_m: float) -> np.ndarray:
    """Return the heights (rows, k) m of a lining from its top (k,) to its end (k,) m: all its bends are among them."""
    step = max(_STEP_M, deep_m / _MOST_STEPS)
    levels = [np.full(len(top), z) for _, _, z in opening.bends_m if end.max() < z < top.min()]
    rows = [top, *levels, end]
    found: list[np.ndarray] = []
    for upper, lower in pairwise(rows):
        far = deep_m if len(rows) == 2 else float((upper - lower).max())
        share = np.linspace(0, 1, max(2, int(np.ceil(far / step)) + 1))[:, None]
        found.append((upper + share * (lower - upper))[bool(found) :])
    return np.concatenate(found)


def _shown(opening: Opening, floor: Floor, rock: RayCaster | None) -> np.ndarray:
    """Return the corners (k, 2) m in the mine frame of a shaft's lining: those of the hole in the visible roof.

    Where no hole is seen, they are those of the shaft.
    """
    section, sections = section_of(opening, floor), sections_shown(opening, floor)
    if opening.sheet is not None or rock is None:
        return section
    for shown in sections:
        ring = shapely.LinearRing(moved_out(shown, -_WITHIN_M)).segmentize(_ACROSS_M)
        if not np.isfinite(_rock_over(rock, shapely.get_coordinates(ring))).any():
            return np.asarray(shown - sections[0] + section)
    return section


def _rock_over(rock: RayCaster, places_m: np.ndarray) -> np.ndarray:
    """Return how far (k,) m over an eye at places (k, 2) m of the plan rock is; infinite where there is none."""
    up = np.broadcast_to([0.0, 0.0, 1.0], (len(places_m), 3))
    return np.asarray(rock.cast(np.column_stack([places_m, np.full(len(places_m), _EYE_M)]), up))


def _roofs_at(
    opening: Opening, floor: Floor, rock: RayCaster | None, places: np.ndarray, ends_m: np.ndarray
) -> np.ndarray:
    """Return how high (k,) m in the mine frame the visible roof is beside a shaft at places (k, 2) m on its walls.

    Where none is seen, it is at the ends of the shaft's collision parts.
    """
    section = section_below(opening, floor)
    if section is None or rock is None:
        return ends_m
    aside = section - section_of(opening, floor)
    middle = section.mean(axis=0)
    plan = places + aside[0]  # also of a shaft that leans: where it meets the roof
    beside = plan + _BESIDE_M * (plan - middle) / np.linalg.norm(plan - middle, axis=1, keepdims=True)
    above = _EYE_M + _rock_over(rock, beside)
    seen = np.isfinite(above)
    roofs = ends_m.copy()
    if seen.any():
        roofs[seen] = Folding(floor).fold(np.column_stack([plan, above])[seen])[:, 2] - _INTO_M
    return roofs


def _fence(opening: Opening, floor: Floor) -> TriangleMesh:
    """Return a fence: outer faces, inner faces and the top of each of its sides."""
    outer = section_of(opening, floor)
    inner, foot = moved_out(outer, -FENCE_M), floor.heights_at(np.array(opening.outline_m))
    low, high = ([np.column_stack([ring, foot + z]) for ring in (outer, inner)] for z in (0.0, FENCE_HEIGHT_M))
    pieces = []
    for k, after in enumerate(np.roll(np.arange(len(outer)), -1)):
        for start, end in (  # each from the left to the right of who sees it, and upwards
            ((low[0][k], low[0][after]), (high[0][k], high[0][after])),
            ((low[1][after], low[1][k]), (high[1][after], high[1][k])),
            ((high[0][k], high[0][after]), (high[1][k], high[1][after])),
        ):
            pieces.append((np.array([*start, *end]), np.array([[0, 1, 3], [0, 3, 2]])))
    return _joined(pieces)


def _grid(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the points (rows * columns, 3) of a grid and its faces (m, 3), seen from the left of its rows."""
    rows, columns = points.shape[:2]
    at = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]
    faces = np.stack([np.dstack([a, b, c]), np.dstack([a, c, d])]).reshape(-1, 3)
    return points.reshape(-1, 3), faces


def _joined(pieces: list[tuple[np.ndarray, np.ndarray]]) -> TriangleMesh:
    """Return one mesh of pieces that share no corner, so that light does not blend over their edges."""
    starts = np.cumsum([0, *(len(points) for points, _ in pieces)])
    points = np.concatenate([points for points, _ in pieces]).round(_DIGITS)
    faces = np.concatenate([faces + start for (_, faces), start in zip(pieces, starts, strict=False)])
    return TriangleMesh(points, faces, np.zeros((0, 2)), np.zeros((0, 3)))
