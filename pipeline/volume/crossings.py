"""Facets of one mesh that cross each other."""

from __future__ import annotations

import numpy as np

from pipeline.volume.rock.separation import ConvexBodies, Facets


def crossing_facets(vertices: np.ndarray, faces: np.ndarray, deeper_than_m: float) -> np.ndarray:
    """Return the pairs (n, 2) of facets (f, 3) of vertices (v, 3) m that reach into each other by more than a depth, m.

    Facets that share an edge or a corner are tried too: they cross where a mesh folds over.
    """
    facets = Facets(vertices, faces)
    corners, normals = facets.corners, facets.normals
    sides = np.roll(corners, -1, axis=1) - corners
    across = np.cross(sides, normals[:, None])
    across /= np.maximum(np.linalg.norm(across, axis=2, keepdims=True), 1e-30)
    directions = np.concatenate([normals[:, None], -normals[:, None], across], axis=1)
    found = facets.crossing(ConvexBodies(corners, directions, sides, np.arange(len(faces))))
    deep = (found.depth_m > deeper_than_m) & (found.body < found.facet)
    return np.column_stack([found.body, found.facet])[deep]
