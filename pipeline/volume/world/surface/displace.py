"""Displace the fine rock of a volume, simplify its mesh, and mend it where it would cross itself."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import count

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pipeline.geometry.facets.inside import Inside
from pipeline.surface.mesh.displacement import Bounds, Room, bound_by_room, damp
from pipeline.surface.mesh.mesh_checks import find_crossings, find_shared_edges
from pipeline.surface.mesh.simplify import Mesher, Simplification, SurfaceMesh
from pipeline.volume.world.surface.crossed import places_crossed
from pipeline.volume.world.surface.fine import FLOOR, FineRock
from pipeline.volume.world.surface.narrow import Narrowest

_RADIUS_M, _FACTOR = 0.6, 0.5  # about a crossing, as the rough surface of a level mine has it
_FLAT_AFTER = 4  # rounds: then the rock about a crossing stays on its collision walls, within
_FLAT_M = 0.3
_WIDER_AFTER = 7  # rounds: then within twice as much in each, up to
_WIDEST_M = 1.2  # more than a displacement and an edge of the fine rock: a facet at a crossing has no relief then
_REFINE_AFTER = 6  # rounds: then what is wrong comes from the simplification; to take relief back before costs no faces
_BEYOND_M = 0.002  # corners of a simplified mesh may reach beyond the bound; in a hollow middles of faces reach farther
_CELL_M = 2.0  # longer than a face: the last round tries all faces, whatever their length
_ABOUT, _KEPT = 2.0, 0.955  # of the distance to walls: faces about the narrowest place, and what these leave of 0.95
_SIMPLIFIED = 0.85  # of the narrow bound: simplification moves rock in, mostly by 4 mm; 0.9 left 0.94995 of Wheal Pell


@dataclass(frozen=True)
class DisplacedRock:
    """The displaced points (n, 3) m of the fine rock, their displacements (n,) m, and the mesh that is made of them.

    `mended` (k, 3) are the repaired places, `crossings` (k, 3) those where the mesh still crosses or touches itself.
    """

    fine: FineRock
    vertices: np.ndarray
    given_m: np.ndarray
    mesh: SurfaceMesh
    mended: np.ndarray
    crossings: np.ndarray


def displace_rock(
    fine: FineRock,
    wanted_m: np.ndarray,
    room: Room,
    bounds: Bounds,
    foot_m: float,
    simplification: Simplification | None,
    free: Inside,
    share: np.ndarray | float = 1.0,
    narrowest: Narrowest | None = None,
) -> DisplacedRock:
    """Displace the rock by `wanted_m` (n,) m, positive into the workings, within its bounds.

    Each point gets a `share` (n,) of what its bounds leave. Floors stay, and the rock over them within `foot_m` moves
    the less the nearer it is. Where the volume's own facets cross in the 32 bits of meshes, the rock is these facets.
    Where the mesh crosses itself or four faces share an edge, the displacement is halved, and after some rounds taken
    back in growing circles, where the mesh is simplified less and less. So it is where the simplified mesh reaches
    farther into the `free` space than the walls' bound, or nearer to the middle of the `narrowest` passage than the
    certificate takes. Rounds end when all rock about what is still wrong is the
    volume's own facets. Each round before takes relief back or simplifies less. What the proof would find then is
    mended in the same way.
    """
    given = _bounded(fine, wanted_m, room, bounds, foot_m) * share
    mesher = Mesher(fine, simplification, digits=None)  # thin rock is less than 0.1 mm wide at its ends
    folded = find_crossings(_in_32_bits(free.mesh[0]), free.mesh[1])
    near = _distance_m(fine.vertices, folded, 2 * _WIDEST_M)
    given = damp(given, np.maximum(near - _WIDEST_M, 0.0), _WIDEST_M, 0.0)
    mesher.refine(fine.vertices[near <= _WIDEST_M], np.inf)
    moved, mended = np.ones(len(given), bool), np.zeros((0, 3))
    for repair in count():
        vertices = _in_32_bits(fine.vertices + given[:, None] * fine.direction)
        points, faces, changed = mesher.mesh(vertices, moved)
        points = _in_32_bits(points)
        faces = _without_short_edges(points, faces)
        kept = _have_three_corners(faces)
        faces, changed = faces[kept], changed[kept]
        wrong = _wrong(points, faces[_are_near(points, faces, changed)], faces[changed])
        if not changed.all() and not len(_with_relief(wrong, vertices, given)[0]):  # tiles meet elsewhere, too
            wrong = _wrong(points, faces, faces)
        beyond = _beyond(points, faces[changed], free, bounds.wall_m + _BEYOND_M)
        narrowing = _narrowing(points, faces[mesher.piece[kept] != FLOOR], narrowest)
        places = np.concatenate([wrong, beyond, narrowing])
        places, settled = _with_relief(places, vertices, given)
        if not len(places) and not mesher.refine(settled):
            # The chunks are judged alone, about another middle: there single precision may find what it misses here.
            rock = faces[mesher.piece[kept] != FLOOR]
            places, own = places_crossed(points, rock, free.mesh)
            near, before = _distance_m(vertices, places[~own], 2 * _WIDEST_M), given
            given = damp(given, np.maximum(near - _WIDEST_M, 0.0), _WIDEST_M, 0.0)
            moved = given != before
            if not mesher.refine(fine.vertices[near <= _WIDEST_M], np.inf) and not moved.any():
                break
            mended = np.concatenate([mended, places[~own]])
            continue
        flat_m = min(_FLAT_M * 2 ** max(0, repair - _WIDER_AFTER + 1), _WIDEST_M)
        near = _distance_m(vertices, places, max(_RADIUS_M, 2 * flat_m))
        if repair >= _REFINE_AFTER:
            mesher.refine(fine.vertices[np.isfinite(near)])
        mended, before = np.concatenate([mended, places]), given
        if repair < _FLAT_AFTER:
            given = damp(given, near, _RADIUS_M, _FACTOR)
        else:
            given = damp(given, np.maximum(near - flat_m, 0.0), flat_m, 0.0)
        moved = given != before
    mesh = SurfaceMesh(points, faces, mesher.piece[kept], mesher.surface(vertices).source)
    return DisplacedRock(fine, vertices, given, mesh, mended, wrong)


def _distance_m(vertices: np.ndarray, places: np.ndarray, most_m: float) -> np.ndarray:
    """Return the distance (n,) m of vertices from the nearest of places (k, 3), inf beyond the most."""
    found = np.full(len(vertices), np.inf)
    if len(places):
        near = _are_beside(vertices, places, most_m)
        found[near] = cKDTree(places).query(vertices[near], distance_upper_bound=most_m)[0]
    return found


def _with_relief(places: np.ndarray, vertices: np.ndarray, given: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return those of places (k, 3) m that are the nearest to some vertex with relief, and the others."""
    relief = np.zeros(len(places), bool)
    if len(places):
        near = vertices[_are_beside(vertices, places, _WIDEST_M) & (given != 0)]
        _, nearest = cKDTree(places).query(near, distance_upper_bound=_WIDEST_M)
        relief[nearest[nearest < len(places)]] = True
    return places[relief], places[~relief]


def _wrong(points: np.ndarray, faces: np.ndarray, some: np.ndarray) -> np.ndarray:
    """Return the places (k, 3) m where some faces cross others, and where more than two faces share an edge."""
    return np.concatenate([find_crossings(points, faces, some), find_shared_edges(points, faces)])


def _are_near(points: np.ndarray, faces: np.ndarray, changed: np.ndarray) -> np.ndarray:
    """Return which faces (m,) have a corner in a cell of `_CELL_M` with one of a face that `changed`, or beside it."""
    if changed.all():
        return changed
    found: np.ndarray = _are_beside(points, points[np.unique(faces[changed])], _CELL_M)[faces].any(axis=1)
    return found


def _are_beside(points: np.ndarray, places: np.ndarray, cell_m: float) -> np.ndarray:
    """Return which points (n,) are in a cell with one of places (k, 3) m, or beside it: all within a cell's side."""
    if not len(places):
        return np.zeros(len(points), bool)
    low = np.minimum(points.min(axis=0), places.min(axis=0))
    ours, theirs = (np.floor((some - low) / cell_m).astype(np.int64) + 1 for some in (points, places))
    count = tuple(np.maximum(ours.max(axis=0), theirs.max(axis=0)) + 2)
    key, own = (np.ravel_multi_index(tuple(cell.T), count) for cell in (ours, theirs))
    beside = [np.ravel_multi_index(one, count) for one in np.ndindex(3, 3, 3)]
    found: np.ndarray = np.isin(key, np.unique(own)[:, None] + np.array(beside) - beside[len(beside) // 2])
    return found


def _beyond(points: np.ndarray, faces: np.ndarray, free: Inside, most_m: float) -> np.ndarray:
    """Return those corners (k, 3) m of faces that are more than `most_m` inside the free space."""
    corners = points[np.unique(faces)]
    return corners[free.are_farther(corners, most_m)]


def _narrowing(points: np.ndarray, faces: np.ndarray, narrowest: Narrowest | None) -> np.ndarray:
    """Return the place (k, 3) m of walls and roofs that leaves too little of the narrowest passage, if one does."""
    if narrowest is None:
        return np.zeros((0, 3))
    away = np.linalg.norm(points[faces].mean(axis=1) - narrowest.middle_m, axis=1)
    near = faces[away < _ABOUT * narrowest.wall_m]
    kept, place = narrowest.kept(points, near) if len(near) else (1.0, narrowest.middle_m)
    return place[None] if kept < _KEPT else np.zeros((0, 3))


def _in_32_bits(points: np.ndarray) -> np.ndarray:
    return points.astype(np.float32).astype(np.float64)


def _without_short_edges(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the faces (m, 3) with one corner for the two of an edge that has no length in 32 bits."""
    ends = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
    short = ends[points[ends[:, 0], 0] == points[ends[:, 1], 0]]
    short = short[(points[short[:, 0]] == points[short[:, 1]]).all(axis=1)]
    if not len(short):
        return faces
    of = connected_components(coo_matrix((np.ones(len(short)), short.T), (len(points),) * 2), directed=False)[1]
    _, first = np.unique(of, return_index=True)
    return np.asarray(first[of][faces])


def _have_three_corners(faces: np.ndarray) -> np.ndarray:
    """Return which faces (m,) have three corners: the two sides of a narrow facet may be one line in 32 bits."""
    return (faces != np.roll(faces, 1, axis=1)).all(axis=1)


def _bounded(fine: FineRock, wanted_m: np.ndarray, room: Room, bounds: Bounds, foot_m: float) -> np.ndarray:
    fixed = fine.is_fixed
    kept = replace(bounds, narrow_share=_SIMPLIFIED * bounds.narrow_share)
    given = bound_by_room(wanted_m, room, kept)
    if fixed.any():
        far, _ = cKDTree(fine.vertices[fixed]).query(fine.vertices, distance_upper_bound=foot_m)
        given = damp(given, far, foot_m, 0.0)
    median_m = float(np.median(np.abs(given[~fixed]))) if not fixed.all() else 0.0
    return given if median_m <= bounds.median_m else given * (bounds.median_m / median_m)
