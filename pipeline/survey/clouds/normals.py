"""The planes of points, turned towards the free space, and the signed distance to the surface that they sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pipeline.survey.clouds.thinned import ThinnedCloud
from pipeline.survey.clouds.voxels import cells_at, is_in, keys_of

_PLANE_POINTS = 16
_NEAR_POINTS = 12
_BLOCK = 200_000
_LOOK = (1.5, 2.5, 3.5, 4.5)  # voxels from a point to either side at which free space is looked for
_MOST_COUNT = 50.0  # points of one voxel count at most so many times
_APART_POINTS, _APART = 4, 2.5  # the fourth point from a stray one is farther than so many times the usual
_SCATTERED, _OFF = 0.2, 0.5  # of the farthest point's distance, and of the fourth's: the points about it are on no wall


@dataclass(frozen=True)
class SidedPoints:
    """The points of a cloud that bound free space, with their planes' normals (n, 3) into it; `rows` of the cloud.

    `thin` are the rows of points with free space on both sides, `beyond` of those with none.
    """

    rows: np.ndarray
    normals: np.ndarray
    thin: np.ndarray
    beyond: np.ndarray


@dataclass(frozen=True)
class PointPlanes:
    """The normals (n, 3) of the planes through each point's nearest points, and how far, m, the last of these is."""

    normals: np.ndarray
    reach_m: np.ndarray

    def without(self, cloud: ThinnedCloud, rows: np.ndarray) -> tuple[ThinnedCloud, PointPlanes]:
        """Return a cloud and its planes without some points: planes to which these belonged are fitted again."""
        left = np.setdiff1d(np.arange(len(cloud)), rows)
        rest, reach, normals = cloud.some(left), self.reach_m[left].copy(), self.normals[left].copy()
        near = cKDTree(cloud.points_m[rows]).query(rest.points_m, distance_upper_bound=float(reach.max(initial=0)))[0]
        again = np.flatnonzero(near <= reach)
        normals[again], reach[again] = _planes(cKDTree(rest.points_m), rest.points_m[again])
        return rest, PointPlanes(normals, reach)


def strays_of(cloud: ThinnedCloud) -> np.ndarray:
    """Return the rows of points that stand apart in the air, such as dust and mirrored ones: they are on no wall.

    The points about those of a wall that was hardly seen are far as well, but lie on a plane with them.
    """
    tree = cKDTree(cloud.points_m)
    fourth = tree.query(cloud.points_m, [min(_APART_POINTS + 1, tree.n)])[0][:, 0]
    rows = np.flatnonzero(fourth > _APART * np.median(fourth))
    if not len(rows):
        return rows
    far, number = tree.query(cloud.points_m[rows], min(_PLANE_POINTS, tree.n))
    near = tree.data[number] - tree.data[number].mean(axis=1, keepdims=True)
    spread, ways = np.linalg.eigh(near.transpose(0, 2, 1) @ near / near.shape[1])
    is_thick = np.sqrt(spread[:, 0].clip(0)) > _SCATTERED * far[:, -1]
    off = np.abs(np.einsum("nk,nk->n", near[:, 0], ways[:, :, 0]))
    return np.asarray(rows[is_thick | (off > _OFF * fourth[rows])])


def planes_of(cloud: ThinnedCloud, rows: np.ndarray | slice = slice(None)) -> PointPlanes:
    """Return the plane of each point, or of some."""
    return PointPlanes(*_planes(cKDTree(cloud.points_m), cloud.points_m[rows]))


def sided(cloud: ThinnedCloud, planes: PointPlanes, free: np.ndarray, size_m: float) -> SidedPoints:
    """Return the points beside a set of free voxels of a size, with normals into it."""
    normals = planes.normals
    seen = np.zeros((2, len(cloud)), int)
    for k, way in enumerate((1, -1)):
        for look in _LOOK:
            seen[k] += is_in(keys_of(cells_at(cloud.points_m + way * look * size_m * normals, size_m)), free)
    thin = (seen > 0).all(axis=0) & (np.abs(seen[0] - seen[1]) <= 1)
    beyond = ~seen.any(axis=0)
    rows = np.flatnonzero(~thin & ~beyond)
    turned = normals[rows] * np.where(seen[0] > seen[1], 1, -1)[rows, None]
    return SidedPoints(rows, turned, np.flatnonzero(thin), np.flatnonzero(beyond))


def _planes(tree: cKDTree, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the normals (n, 3) of the planes through the nearest points, and how far the last of these are."""
    normals, reach = np.zeros((len(points), 3)), np.zeros(len(points))
    for k in range(0, len(points), _BLOCK):
        far, rows = tree.query(points[k : k + _BLOCK], min(_PLANE_POINTS, tree.n))
        near = tree.data[rows] - tree.data[rows].mean(axis=1, keepdims=True)
        normals[k : k + _BLOCK] = np.linalg.eigh(near.transpose(0, 2, 1) @ near)[1][:, :, 0]
        reach[k : k + _BLOCK] = far[:, -1]
    return normals, reach


class SignedDistance:
    """The distance to the surface of points with normals, m, positive in the free space: a mean of their planes'."""

    def __init__(self, points_m: np.ndarray, normals: np.ndarray, count: np.ndarray, smooth_m: float) -> None:
        """Take points with normals and the weight of each; planes are weighted within about `smooth_m`."""
        self.tree, self.normals = cKDTree(points_m), normals
        self.count, self.smooth_m = np.minimum(count, _MOST_COUNT), smooth_m

    def at(self, places: np.ndarray) -> np.ndarray:
        """Return the distance (n,) at places (n, 3) m."""
        blocks = [self._at(places[k : k + _BLOCK]) for k in range(0, len(places), _BLOCK)]
        return np.concatenate([np.zeros(0), *blocks])

    def _at(self, places: np.ndarray) -> np.ndarray:
        far, near = self.tree.query(places, min(_NEAR_POINTS, self.tree.n))
        # Far from all points the reach grows, so that planes about a hole carry on into it.
        reach = np.maximum(self.smooth_m, 0.7 * far[:, :1])
        weight = self.count[near] * np.exp(-0.5 * (far / reach) ** 2)
        off = np.einsum("nki,nki->nk", places[:, None] - self.tree.data[near], self.normals[near])
        return np.asarray((weight * off).sum(axis=1) / weight.sum(axis=1))
