"""The surface of free voxels at the resolution of a scan: marching cubes in blocks, on the signed distance."""

from __future__ import annotations

import numpy as np
from skimage.measure import marching_cubes

from pipeline.survey.clouds.normals import SignedDistance
from pipeline.survey.clouds.voxels import cells_of_keys, is_in, keys_of

_BLOCK = 32  # cubes along a block's side
_WELD = 1e4  # parts of a voxel


def surface_of(
    free: np.ndarray, band: np.ndarray, size_m: float, signed: SignedDistance
) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (n, 3) m and triangles (m, 3) of the surface, whose normals point out of the free space.

    Parameters
    ----------
    free : (n,) int64
        Voxels that the flood reached: all of it is free.
    band : (k,) int64
        Those and the voxels about them in which the surface may lie.
    size_m : float
        Of those voxels.
    signed : SignedDistance
    """
    blocks = np.unique(np.floor_divide(cells_of_keys(band), _BLOCK), axis=0)
    blocks = np.unique(np.concatenate([blocks, *(blocks - lag for lag in np.ndindex(2, 2, 2))]), axis=0)
    nodes = np.stack(np.meshgrid(*[np.arange(_BLOCK + 1)] * 3, indexing="ij"), axis=-1)
    corners, triangles, count = [], [], 0
    for block in blocks:
        at = nodes + block * _BLOCK
        values = _values(at.reshape(-1, 3), free, band, size_m, signed).reshape(nodes.shape[:3])
        if not values.min() < 0 < values.max():
            continue
        found, faces, _, _ = marching_cubes(values, 0.0)
        corners.append(found + block * _BLOCK)
        triangles.append(faces + count)
        count += len(found)
    if not corners:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    every = np.concatenate(corners)
    _, first, number = np.unique(
        np.round(every * _WELD).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    faces = number.reshape(-1)[np.concatenate(triangles)]
    return (every[first] + 0.5) * size_m, faces


def _values(cells: np.ndarray, free: np.ndarray, band: np.ndarray, size_m: float, signed: SignedDistance) -> np.ndarray:
    """Return the signed distance at the middles of cells (n, 3), at most two voxels."""
    keys, most = keys_of(cells), 2.0 * size_m
    values = np.full(len(cells), -most, np.float32)
    inside = is_in(keys, free)
    values[inside] = most
    about = is_in(keys, band) & ~inside
    values[about] = np.clip(signed.at((cells[about] + 0.5) * size_m), -most, most)
    values[values == 0] = 1e-6
    return values
