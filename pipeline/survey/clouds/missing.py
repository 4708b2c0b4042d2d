"""What a scan lacks that encloses no space: points over its floor, below its roof, or opposite its walls."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from pipeline.survey.clouds.facing import SIGHT_M
from pipeline.survey.clouds.voxels import cells_at, grown, is_in, keys_of

_POINTS = 1000  # of each kind that are looked from
_LEVEL, _UPRIGHT = 0.8, 0.5  # of a normal along z: at least that of floors and roofs, at most that of walls
_FIRST = 3  # voxels from a point to where the wall that it lies in is behind
_MOST = 0.5  # of a kind's points without any opposite
_NEAR_WALLS = 16  # points of walls by which a level surface is a floor or a roof
_SEED = 0


def missing_sides(points_m: np.ndarray, normals: np.ndarray, size_m: float) -> list[str]:
    """Return what most points of floors, roofs or walls have nothing opposite to, in words; empty if they have.

    Parameters
    ----------
    points_m : (n, 3) float64, m
    normals : (n, 3) float64
        Of the points' planes, to either side.
    size_m : float
        Of the voxels with points: gaps this wide hide nothing.
    """
    thick = grown(np.unique(keys_of(cells_at(points_m, size_m))))
    rng, steep = np.random.default_rng(_SEED), np.abs(normals[:, 2])
    level, upright = (rng.permutation(np.flatnonzero(rows)) for rows in (steep >= _LEVEL, steep <= _UPRIGHT))
    found = []
    bare = _bare(points_m[level[:_POINTS]], normals[level[:_POINTS]], thick, size_m)
    if bare.mean() > _MOST:
        found.append(_of_level(points_m[level[:_POINTS]][bare], points_m[upright]))
    bare = _bare(points_m[upright[:_POINTS]], normals[upright[:_POINTS]], thick, size_m)
    if bare.mean() > _MOST:
        found.append("opposite most of its walls there are no points: it shows one side of the workings")
    return found


def _bare(points_m: np.ndarray, normals: np.ndarray, thick: np.ndarray, size_m: float) -> np.ndarray:
    """Return which points (n, 3) have no voxel of a set before or behind them; one False if there are no points."""
    if not len(points_m):
        return np.zeros(1, bool)
    far = size_m * np.arange(_FIRST, max(_FIRST + 1, int(SIGHT_M / size_m)))
    bare = np.ones(len(points_m), bool)
    for way in (1, -1):
        places = points_m[:, None] + way * far[:, None] * normals[:, None]
        bare &= ~is_in(keys_of(cells_at(places.reshape(-1, 3), size_m)), thick).reshape(places.shape[:2]).any(axis=1)
    return bare


def _of_level(bare_m: np.ndarray, walls_m: np.ndarray) -> str:
    """Return what level points (n, 3) m without any above or below lack, by the walls beside them."""
    if len(walls_m) < _NEAR_WALLS:
        return "above and below most of its level surface there are no points: it is a floor or a roof alone"
    near = cKDTree(walls_m[:, :2]).query(bare_m[:, :2], _NEAR_WALLS)[1]
    if np.median(walls_m[near, 2].mean(axis=1) - bare_m[:, 2]) > 0:
        return "above most of its floor there are no points: it has no roof"
    return "below most of its roof there are no points: it has no floor"
