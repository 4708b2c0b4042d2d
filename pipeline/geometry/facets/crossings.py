"""Facets of one mesh that cross each other."""

from __future__ import annotations

import numpy as np

from pipeline.geometry.facets.separation import ConvexBodies, Facets, boxes_near, boxes_of

CROSSING_M = 1e-6  # facets that are less deep in each other touch


def crossing_facets(
    vertices: np.ndarray,
    faces: np.ndarray,
    deeper_than_m: float,
    some: np.ndarray | None = None,
    of: np.ndarray | None = None,
) -> np.ndarray:
    """Return the pairs (n, 2) of facets (f, 3) of vertices (v, 3) m that reach into each other by more than a depth, m.

    Facets that share an edge or a corner are tried too: they cross where a mesh folds over. With `some`, a mask (f,),
    only these are tried against all. With `of` (f,), only facets of one number are tried against each other.
    """
    numbers = np.arange(len(faces))
    if some is not None:
        low, high = boxes_of(vertices[faces])
        numbers = boxes_near(low, high, low[some], high[some])
    facets = Facets(vertices, faces[numbers])
    tried = np.ones(len(faces), bool) if some is None else some[numbers]
    one_of = None if of is None else of[numbers]
    chosen = np.flatnonzero(tried)

    corners, normals = facets.corners[chosen], facets.normals[chosen]
    sides = np.roll(corners, -1, axis=1) - corners
    across = np.cross(sides, normals[:, None])
    across /= np.maximum(np.linalg.norm(across, axis=2, keepdims=True), 1e-30)
    directions = np.concatenate([normals[:, None], -normals[:, None], across], axis=1)
    found = facets.crossing(ConvexBodies(corners, directions, sides, chosen), tried=tried, of=one_of)
    pairs = np.sort(np.column_stack([chosen[found.body], found.facet])[found.depth_m > deeper_than_m], axis=1)
    unique: np.ndarray = np.unique(numbers[pairs], axis=0)
    return unique


def crosses_more(
    vertices: np.ndarray, faces: np.ndarray, before: tuple[np.ndarray, np.ndarray], deeper_than_m: float
) -> np.ndarray:
    """Return the facets (n,) of a changed mesh that cross others, if more pairs cross than in the mesh before it.

    Only facets that are in one of the two meshes alone are tried: the others cross each other in both.
    """
    ours, theirs = _keys(vertices[faces]), _keys(before[0][before[1]])
    pairs = crossing_facets(vertices, faces, deeper_than_m, ~np.isin(ours, theirs))
    if len(pairs) and len(pairs) <= len(crossing_facets(*before, deeper_than_m, ~np.isin(theirs, ours))):
        pairs = pairs[:0]
    return np.unique(pairs)


def _keys(corners: np.ndarray) -> np.ndarray:
    """Return a number (f,) for each facet, the same for facets with the same corners (f, 3, 3)."""
    x, y, z = np.moveaxis(corners, 2, 0)
    one, two, three = np.sort(x + y * np.sqrt(2) + z * np.sqrt(3), axis=1).T
    found: np.ndarray = one + two * np.sqrt(5) + three * np.sqrt(7)
    return found
