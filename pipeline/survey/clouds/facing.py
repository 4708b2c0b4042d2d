"""Which side of the points of a scan is free, from the points alone: planes of neighbours are turned alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree
from scipy.spatial import cKDTree

from pipeline.survey.clouds.voxels import cells_at, is_in, keys_of

_NEIGHBOURS = 8
_BLOCK = 200_000
_LEAST_WEIGHT = 1e-3  # of two points on one plane: a sparse matrix has no edge of weight 0
_VOTES = 2000  # points of a piece from which both sides are looked at
_FIRST = 2.5  # voxels from a point to where the wall that it lies in is behind
SIGHT_M = 30.0  # how far off a wall still encloses a place


@dataclass(frozen=True)
class OrientedPoints:
    """Points (n, 3) m of a surface, and normals (n, 3) into the free space."""

    points_m: np.ndarray
    normals: np.ndarray

    def normals_at(self, places: np.ndarray) -> np.ndarray:
        """Return the normals (k, 3) of the points nearest to places (k, 3) m."""
        return np.asarray(self.normals[cKDTree(self.points_m).query(places)[1]])


def turned_alike(points_m: np.ndarray, normals: np.ndarray, thick: np.ndarray, size_m: float) -> OrientedPoints:
    """Return points with normals of which neighbours show to the same side of the surface that they sample.

    They are turned along the flattest paths between neighbours (Hoppe et al. 1992, doi:10.1145/142920.134011), in each
    piece to the side on which more of them see a wall.

    Parameters
    ----------
    points_m, normals : (n, 3) float64
    thick : (k,) int64
        Voxels of the thickened walls.
    size_m : float
        Of those voxels.
    """
    graph = _neighbours(points_m, normals)
    tree = minimum_spanning_tree(graph)
    pieces, part = connected_components(tree, directed=False)
    sign = np.ones(len(points_m))
    first = np.unique(part, return_index=True)[1]
    for start in first[np.bincount(part, minlength=pieces) > 1].tolist():
        order, before = breadth_first_order(tree, start, directed=False)
        _turn(order, before, normals, sign)
    turned: np.ndarray = normals * sign[:, None]
    by_piece = np.argsort(part, kind="stable")
    for rows in np.split(by_piece, np.cumsum(np.bincount(part))[:-1]):
        some = rows[:: max(1, len(rows) // _VOTES)]
        ahead, behind = (_sees(points_m[some], way * turned[some], thick, size_m).sum() for way in (1, -1))
        if behind > ahead:
            turned[rows] *= -1
    return OrientedPoints(points_m, turned)


def _neighbours(points: np.ndarray, normals: np.ndarray) -> csr_array:
    """Return a graph of near points; a step along a plane weighs little, one across it or round an edge much."""
    count, tree = len(points), cKDTree(points)
    wide = min(_NEIGHBOURS, count - 1)
    other, weight = np.zeros((count, wide), np.int32), np.zeros((count, wide))
    for k in range(0, count, _BLOCK):
        own = slice(k, k + _BLOCK)
        far, near = tree.query(points[own], wide + 1)
        other[own] = near[:, 1:]
        step = (points[other[own]] - points[own, None]) / np.maximum(far[:, 1:, None], 1e-9)
        theirs = normals[other[own]]
        bend = 1 - np.abs(np.einsum("ij,ikj->ik", normals[own], theirs))
        across = np.abs(np.einsum("ikj,ij->ik", step, normals[own])) + np.abs(np.einsum("ikj,ikj->ik", step, theirs))
        weight[own] = bend + across + _LEAST_WEIGHT
    starts = np.arange(0, count * wide + 1, wide)
    return csr_array((weight.ravel(), other.ravel(), starts), (count, count))


def _turn(order: np.ndarray, before: np.ndarray, normals: np.ndarray, sign: np.ndarray) -> None:
    """Set the signs of a tree's points, each to that of the one before it."""
    agrees = np.ones(len(sign))
    inner = order[1:]
    agrees[inner] = np.where(np.einsum("ij,ij->i", normals[inner], normals[before[inner]]) < 0, -1.0, 1.0)
    for own in inner.tolist():
        sign[own] = sign[before[own]] * agrees[own]


def _sees(points: np.ndarray, way: np.ndarray, thick: np.ndarray, size_m: float) -> np.ndarray:
    """Return from which points (n, 3) m a wall lies within sight in a direction (n, 3)."""
    found = np.zeros(len(points), bool)
    for far in np.arange(_FIRST * size_m, SIGHT_M, size_m):
        left = np.flatnonzero(~found)
        found[left] = is_in(keys_of(cells_at(points[left] + far * way[left], size_m)), thick)
    return found
