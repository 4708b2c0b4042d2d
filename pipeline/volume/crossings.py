"""Facets of one mesh that cross each other."""

from __future__ import annotations

import numpy as np

from pipeline.volume.separation import ConvexBodies, Facets

CROSSING_M = 1e-6  # facets that are less deep in each other touch


def crossing_facets(
    vertices: np.ndarray, faces: np.ndarray, deeper_than_m: float, some: np.ndarray | None = None
) -> np.ndarray:
    """Return the pairs (n, 2) of facets (f, 3) of vertices (v, 3) m that reach into each other by more than a depth, m.

    Facets that share an edge or a corner are tried too: they cross where a mesh folds over. With `some`, a mask (f,),
    only these are tried against all.
    """
    facets = Facets(vertices, faces)
    tried = np.ones(len(faces), bool) if some is None else some
    chosen = np.flatnonzero(tried)
    corners, normals = facets.corners[chosen], facets.normals[chosen]
    sides = np.roll(corners, -1, axis=1) - corners
    across = np.cross(sides, normals[:, None])
    across /= np.maximum(np.linalg.norm(across, axis=2, keepdims=True), 1e-30)
    directions = np.concatenate([normals[:, None], -normals[:, None], across], axis=1)
    found = facets.crossing(ConvexBodies(corners, directions, sides, chosen), tried=tried)
    pairs = np.sort(np.column_stack([chosen[found.body], found.facet])[found.depth_m > deeper_than_m], axis=1)
    unique: np.ndarray = np.unique(pairs, axis=0)
    return unique
