"""The surface of free voxels at the resolution of a scan: marching cubes in blocks, on the signed distance."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree
from skimage.measure import marching_cubes

from pipeline.survey.clouds.gaps import GapPlate
from pipeline.survey.clouds.normals import SignedDistance
from pipeline.survey.clouds.voxels import cells_at, cells_of_keys, is_in, keys_of

_BLOCK = 32  # cubes along a block's side
_WELD = 1e4  # parts of a voxel
_BEHIND = 3  # voxels from a gap's corners to what lies behind its plate
_NODES = np.stack(np.meshgrid(*[np.arange(_BLOCK + 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


class BlockSurface:
    """The surface of a set of free voxels, block by block, so that some of it can be found again."""

    def __init__(self, free: np.ndarray, band: np.ndarray, size_m: float, signed: SignedDistance) -> None:
        """Find it.

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
        self._free, self._band, self._size_m, self._signed = free, band, size_m, signed
        self._found: dict[tuple[int, ...], tuple[np.ndarray, np.ndarray]] = {}
        for block in _blocks_about(np.floor_divide(cells_of_keys(band), _BLOCK)):
            self._find(block, [])

    def close(self, plates: list[GapPlate]) -> None:
        """Find the surface about gaps again, where nothing behind their plates is free.

        A flood ends behind the plane of a hole, and folds there.
        """
        about: dict[tuple[int, ...], list[GapPlate]] = {}
        for plate in plates:
            cells = np.floor_divide(cells_at(plate.corners_m, self._size_m), _BLOCK)
            for block in _blocks_about(np.concatenate([cells, cells + 1])):
                about.setdefault(block, []).append(plate)
        for block in sorted(set(about) & set(self._found)):
            self._find(block, about[block])

    def mesh(self) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices (n, 3) m and triangles (m, 3) of the surface, whose normals point out of the free space."""
        if not self._found:
            return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
        corners, triangles = zip(*self._found.values(), strict=True)
        before = np.cumsum([0, *map(len, corners)])
        every = np.concatenate(corners)
        _, first, number = np.unique(
            np.round(every * _WELD).astype(np.int64), axis=0, return_index=True, return_inverse=True
        )
        faces = number.reshape(-1)[np.concatenate([own + k for own, k in zip(triangles, before, strict=False)])]
        return (every[first] + 0.5) * self._size_m, faces

    def _find(self, block: tuple[int, ...], plates: list[GapPlate]) -> None:
        cells = np.array(block) * _BLOCK + _NODES
        values = _values(cells, self._free, self._band, self._size_m, self._signed)
        for plate in plates:
            places = (cells + 0.5) * self._size_m
            far = cKDTree(plate.corners_m).query(places, distance_upper_bound=_BEHIND * self._size_m)[0]
            near = np.flatnonzero(np.isfinite(far))
            values[near] = np.minimum(values[near], plate.height_m(places[near]))
        values[values == 0] = 1e-6
        cube = values.reshape((_BLOCK + 1,) * 3)
        self._found.pop(block, None)
        if cube.min() < 0 < cube.max():
            corners, triangles, _, _ = marching_cubes(cube, 0.0)
            self._found[block] = corners + np.array(block) * _BLOCK, triangles


def _blocks_about(blocks: np.ndarray) -> list[tuple[int, ...]]:
    """Return blocks (n, 3) and those before them along each axis, which share their first layer of corners."""
    own = np.unique(blocks, axis=0)
    return [
        tuple(row) for row in np.unique(np.concatenate([own - lag for lag in np.ndindex(2, 2, 2)]), axis=0).tolist()
    ]


def _values(cells: np.ndarray, free: np.ndarray, band: np.ndarray, size_m: float, signed: SignedDistance) -> np.ndarray:
    """Return the signed distance at the middles of cells (n, 3), at most two voxels."""
    keys, most = keys_of(cells), 2.0 * size_m
    values = np.full(len(cells), -most, np.float32)
    inside = is_in(keys, free)
    values[inside] = most
    about = is_in(keys, band) & ~inside
    values[about] = np.clip(signed.at((cells[about] + 0.5) * size_m), -most, most)
    return values
