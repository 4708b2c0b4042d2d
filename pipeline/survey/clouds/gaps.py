"""Where the surface of a scan was not seen: holes that are closed, and ends of what was scanned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

_LEAST_M2 = 0.03


@dataclass(frozen=True)
class Gap:
    """A part of the surface with no points near: its middle, m, its area, m2, and the width, m, of a circle of it."""

    middle_m: tuple[float, float, float]
    area_m2: float

    @property
    def width_m(self) -> float:
        """Return the width of a circle of the same area."""
        return float(2 * np.sqrt(self.area_m2 / np.pi))


def find_gaps(vertices: np.ndarray, faces: np.ndarray, points_m: np.ndarray, far_m: float) -> list[Gap]:
    """Return the parts of a surface that are farther than `far_m` from all points, the largest first."""
    corners = vertices[faces]
    middles = corners.mean(axis=1)
    bare = np.flatnonzero(cKDTree(points_m).query(middles, distance_upper_bound=far_m)[0] > far_m)
    if not len(bare):
        return []
    a, b, c = np.moveaxis(corners[bare], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    used, number = np.unique(faces[bare], return_inverse=True)
    ends = number.reshape(-1, 3)
    pairs = np.concatenate([ends[:, :2], ends[:, 1:]])
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), (len(used),) * 2)
    part = connected_components(graph, directed=False)[1][ends[:, 0]]
    size = np.bincount(part, area)
    middle = np.column_stack([np.bincount(part, area * middles[bare, k]) for k in range(3)]) / np.maximum(
        size, 1e-12
    )[:, None]
    found = [
        Gap((float(x), float(y), float(z)), float(m2))
        for (x, y, z), m2 in zip(middle, size, strict=True)
        if m2 >= _LEAST_M2
    ]
    return sorted(found, key=lambda gap: -gap.area_m2)
