"""Random points on triangle meshes, uniform by area."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

_BLOCK = 1 << 16
_TABLE_STEPS = 4  # after which the few numbers that are left are searched


def sample_triangles(triangles: np.ndarray, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw points (count, 3) m uniformly from triangles (n, 3, 3) m; return them and the indices of their faces."""
    doubled = np.linalg.norm(_doubled_normals(triangles), axis=1)
    total = np.cumsum(doubled)
    face = np.minimum(_search_sums(total, rng.random(count) * total[-1]), len(triangles) - 1)
    random, points = rng.random((2, count)), np.empty((count, 3))
    for at in range(0, count, _BLOCK):  # the corners of all points at once would take three times the points' memory
        block = slice(at, at + _BLOCK)
        u, v = random[:, block]
        root = np.sqrt(u)
        share = np.column_stack([1 - root, root * (1 - v), root * v])
        np.einsum("ij,ijk->ik", share, triangles.take(face[block], axis=0), out=points[block])
    return points, face


def unit_normals(triangles: np.ndarray) -> np.ndarray:
    """Return the unit normals (n, 3) of triangles (n, 3, 3)."""
    normal = _doubled_normals(triangles)
    return normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-30)[:, None]


def _doubled_normals(triangles: np.ndarray) -> np.ndarray:
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def _search_sums(total: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return what `np.searchsorted(total, wanted)` does, for sums (n,) and numbers (k,) between 0 and the last sum.

    A table says where even steps stand among the sums; from there most numbers are found within four places. A search
    for each number takes eight times as long.
    """
    steps = 2 * len(total)
    if not 0 < total[-1] < np.inf:
        return np.searchsorted(total, wanted)
    table = np.searchsorted(total, np.arange(steps) * (total[-1] / steps))
    found = table.take(np.maximum((wanted * (steps / total[-1])).astype(np.int64) - 1, 0))
    behind = np.flatnonzero(total.take(found) < wanted)
    for _ in range(_TABLE_STEPS):
        found[behind] += 1
        behind = behind[total.take(found[behind]) < wanted[behind]]
    found[behind] = np.searchsorted(total, wanted[behind])
    return found


def faces_near(triangles: np.ndarray, places: np.ndarray, radius_m: float) -> np.ndarray:
    """Return the triangles (k, 3, 3) whose centres lie within a radius of any of the places (p, 2), in plan."""
    near, _ = cKDTree(places).query(triangles.mean(axis=1)[:, :2], distance_upper_bound=radius_m)
    return triangles[np.isfinite(near)]


def add_noise(
    points: np.ndarray,
    normals: np.ndarray,
    face: np.ndarray,
    along_m: float,
    in_plane_m: float,
    rng: np.random.Generator,
) -> None:
    """Add Gaussian noise: s.d. `along_m` along a point's normal plus `in_plane_m` in every direction.

    Parameters
    ----------
    points : (n, 3) float64, m
        They are changed.
    normals : (k, 3) float64
        Unit normals of faces.
    face : (n,) int
        Each point's face.
    along_m, in_plane_m : float
    rng : numpy.random.Generator
    """
    along = rng.normal(0, along_m, (len(points), 1))
    for at in range(0, len(points), _BLOCK):
        block = slice(at, at + _BLOCK)
        noisy = normals.take(face[block], axis=0) * along[block]
        points[block] += noisy
        points[block] += rng.normal(0, in_plane_m, noisy.shape)
