"""Meshes of which no two corners are at one place."""

from __future__ import annotations

import numpy as np

from pipeline.geometry.facets.crossings import CROSSING_M, crossing_facets

_APART_M = (1e-3, 3e-4, 1e-4)  # by which corners at one place are moved: the most that makes no facets cross


def parted(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the vertices (n, 3) m of a mesh of which none are at one place in the 32 bits of meshes.

    Where a space touches itself in a corner or an edge, its corners move by up to a millimetre to their neighbours.
    """
    _, of, count = np.unique(vertices.astype(np.float32), axis=0, return_inverse=True, return_counts=True)
    touch = np.flatnonzero(count[of.reshape(-1)] > 1)
    if not len(touch):
        return vertices
    ends = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])  # each edge of a closed mesh both ways
    mean = np.stack([np.bincount(ends[:, 0], vertices[ends[:, 1], k], len(vertices)) for k in range(3)], axis=1)
    way = mean[touch] / np.bincount(ends[:, 0], minlength=len(vertices))[touch, None] - vertices[touch]
    way /= np.maximum(np.linalg.norm(way, axis=1), 1e-9)[:, None]
    about = np.asarray(np.isin(faces, touch).any(axis=1))
    for apart_m in _APART_M:
        found = vertices.copy()
        found[touch] += apart_m * way
        if not len(crossing_facets(found, faces, CROSSING_M, about)):
            return found
    return vertices
