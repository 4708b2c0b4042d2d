"""Displace the fine rock of a volume, simplify its mesh, and mend it where it would cross itself."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from pipeline.surface.mesh.displacement import Bounds, Room, bound_by_room, damp
from pipeline.surface.mesh.mesh_checks import find_crossings, find_shared_edges
from pipeline.surface.mesh.simplify import Mesher, Simplification, SurfaceMesh
from pipeline.volume.surface.fine import FineRock

_ROUNDS = 10
_RADIUS_M, _FACTOR = 0.6, 0.5  # about a crossing, as the rough surface of a level mine has it
_FLAT_AFTER = 4  # rounds: then the rock about a crossing stays on its collision walls
_REFINE_AFTER = 2  # rounds: then what is wrong may come from the simplification
_DIGITS = 4  # 0.1 mm
_SIMPLIFIED = 0.9  # of the narrow bound: the simplification moves the rock inwards by up to 4 mm


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
) -> DisplacedRock:
    """Displace the rock by `wanted_m` (n,) m, positive into the workings, within its bounds.

    Floors stay, and the rock over them within `foot_m` moves the less the nearer it is. Where the mesh crosses itself
    or four faces share an edge, the displacement is halved, and after some rounds taken back. What then still crosses
    does so in the volume itself.
    """
    given = _bounded(fine, wanted_m, room, bounds, foot_m)
    mesher = Mesher(fine, simplification)
    moved, mended = np.ones(len(given), bool), np.zeros((0, 3))
    for repair in range(_ROUNDS + 1):
        vertices = fine.vertices + given[:, None] * fine.direction
        vertices = np.where(given[:, None] == 0, vertices, np.round(vertices, _DIGITS))  # facets that touch stay exact
        points, faces, changed = mesher.mesh(vertices, moved)
        wrong = np.concatenate([find_crossings(points, faces, faces[changed]), find_shared_edges(points, faces)])
        if not len(wrong) and not changed.all():  # tiles meet elsewhere, too
            wrong = find_crossings(points, faces)
        if not len(wrong) or repair == _ROUNDS:
            return DisplacedRock(fine, vertices, given, mesher.surface(vertices), mended, wrong)
        mended = np.concatenate([mended, wrong])
        if repair >= _REFINE_AFTER:
            mesher.refine(wrong)
        near, _ = cKDTree(wrong).query(vertices, distance_upper_bound=_RADIUS_M)
        if repair < _FLAT_AFTER:
            given = damp(given, near, _RADIUS_M, _FACTOR)
        else:
            given = damp(given, np.maximum(near - _RADIUS_M / 2, 0.0), _RADIUS_M / 2, 0.0)
        moved = np.isfinite(near)
    raise AssertionError("unreachable")


def _bounded(fine: FineRock, wanted_m: np.ndarray, room: Room, bounds: Bounds, foot_m: float) -> np.ndarray:
    fixed = fine.is_fixed
    kept = replace(bounds, narrow_share=_SIMPLIFIED * bounds.narrow_share)
    given = bound_by_room(wanted_m, room, kept)
    if fixed.any():
        given = damp(given, cKDTree(fine.vertices[fixed]).query(fine.vertices)[0], foot_m, 0.0)
    median_m = float(np.median(np.abs(given[~fixed]))) if not fixed.all() else 0.0
    return given if median_m <= bounds.median_m else given * (bounds.median_m / median_m)
