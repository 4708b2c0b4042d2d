"""Whether two triangle surfaces are the same, however they are cut into triangles."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from pipeline.geometry.nearest_facets import NearestFacets
from pipeline.types import Mesh

_CORNER_M = 0.01  # far from the origin a vertex has millimetres
_APART_M = 0.1  # between the same corners: a diagonal across a bend may run either way
_AREA_SHARE = 2e-3
_SLIVER_M2 = 1e-4  # smaller faces have no reliable normal
_SAME_SIDE = 0.5  # cosine between normals of the two surfaces


def surfaces_differ(found: Mesh, wanted: Mesh) -> str | None:
    """Return how a surface differs from another in place, area or side, or None if it does not."""
    one, two = found.vertices[found.faces], wanted.vertices[wanted.faces]
    differs = triangles_differ(one, two)
    if differs is None and (len(one) != len(two) or _rim(found.faces) != _rim(wanted.faces)):
        return f"{len(one)} faces and a rim of {_rim(found.faces)} edges, want {len(two)} and {_rim(wanted.faces)}"
    return differs


def triangles_differ(one: np.ndarray, two: np.ndarray) -> str | None:
    """Return how triangles (n, 3, 3) m differ from others in place, area or side, or None if they do not."""
    areas = [float(np.linalg.norm(_crossed(t), axis=1).sum() / 2) for t in (one, two)]
    if abs(areas[0] - areas[1]) > _AREA_SHARE * areas[1]:
        return f"an area of {areas[0]:.3f} m2, want {areas[1]:.3f} m2"
    corners = one.reshape(-1, 3), two.reshape(-1, 3)
    off = max(float(cKDTree(a).query(b)[0].max()) for a, b in (corners, corners[::-1]))
    if not off <= _CORNER_M:
        return f"a corner {off:.4f} m from where it should be"
    found, back = NearestFacets.of(two).query(_samples(one)), NearestFacets.of(one).query(_samples(two))
    worst = max(float(found.distance_m.max()), float(back.distance_m.max()))
    if not worst <= _APART_M:
        return f"{worst:.4f} m from where it should be"
    facing = np.einsum("ij,ij->i", _unit(_crossed(one)), _unit(_crossed(two))[found.facet[: len(one)]])
    size = np.linalg.norm(_crossed(one), axis=1) / 2
    if ((facing < _SAME_SIDE) & (size > _SLIVER_M2)).any():
        return "a face that faces the wrong way"
    return None


def _rim(faces: np.ndarray) -> int:
    """Return the number of edges that have a face on one side only, or -1 if an edge has two faces on one side."""
    ahead = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    code, back = (ahead[:, i] * (faces.max() + 1) + ahead[:, 1 - i] for i in (0, 1))
    return -1 if len(np.unique(code)) < len(code) else int((~np.isin(code, back)).sum())


def _samples(triangles: np.ndarray) -> np.ndarray:
    """Return centres, corners and middles of sides, the centres first."""
    sides = (triangles + np.roll(triangles, -1, axis=1)) / 2
    return np.concatenate([triangles.mean(axis=1), triangles.reshape(-1, 3), sides.reshape(-1, 3)])


def _crossed(triangles: np.ndarray) -> np.ndarray:
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-30)
