"""What a closed mesh that crosses itself encloses, found again on a grid in boxes about where it does."""

from __future__ import annotations

import numpy as np
from skimage.measure import marching_cubes

from pipeline.geometry.ray_scene import ray_scene
from pipeline.scans.meshes.winding import WindingNumber

_BLOCK = 8  # cubes along a block's side
_NODES = np.stack(np.meshgrid(*[np.arange(_BLOCK + 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
_MOST, _LEAST = 4.0, 0.02  # cells: distances are no larger, and no smaller, as corners on nodes would be one
_WELD = 1e4  # parts of a cell
_TOGETHER = 200  # blocks
_BITS, _HALF = 20, 1 << 19


def rebuilt_within(
    vertices: np.ndarray, faces: np.ndarray, cell_m: float, boxes_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the surface of what a closed mesh encloses once or more, in the blocks that boxes reach into.

    None of its facets cross. Where the blocks end so does the space, within a fiftieth of a cell.

    Parameters
    ----------
    vertices, faces : (n, 3) float64 m, (m, 3) int
        Normals point out of the space.
    cell_m : float
        Of the grid: what is thinner may be lost.
    boxes_m : (k, 2, 3) float64, m
        Least and largest corner. Blocks of eight cells that come within a cell of one are found.

    Returns
    -------
    (k, 3) float64 m, (j, 3) int
    """
    winding, middle = WindingNumber(vertices, faces), vertices.mean(axis=0)
    scene = ray_scene(vertices - middle, faces)
    keys = _blocks_about(boxes_m + np.array([[-cell_m], [cell_m]]), cell_m)
    corners, triangles, count = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    for k in range(0, len(keys), _TOGETHER):
        blocks = _cells_of(keys[k : k + _TOGETHER])
        nodes = (blocks[:, None] * _BLOCK + _NODES).reshape(-1, 3)
        places = nodes * cell_m
        inside = (
            winding.at(places, (nodes[:, 0] + (_HALF << 3) << 2 * _BITS) | (nodes[:, 1] + (_HALF << 3)), cell_m) > 0
        )
        far = scene.compute_distance((places - middle).astype(np.float32)).numpy() / cell_m
        far = np.clip(far, _LEAST, _MOST)
        values = np.where(inside, far, -far).reshape(len(blocks), -1)
        _end(values, blocks, keys)
        for block, own in zip(blocks, values.reshape(-1, *[_BLOCK + 1] * 3), strict=True):
            if own.min() < 0 < own.max():
                found, three, _, _ = marching_cubes(own, 0.0, gradient_direction="ascent")
                corners.append(found + block * _BLOCK)
                triangles.append(three + count)
                count += len(found)
    every = np.concatenate(corners)
    rounded = np.round(every * _WELD).astype(np.int64)
    _, first, number = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    return every[first] * cell_m, number.reshape(-1)[np.concatenate(triangles)]


def _end(values: np.ndarray, blocks: np.ndarray, keys: np.ndarray) -> None:
    """Set values (n, 729) of blocks (n, 3) outside at nodes beside blocks that are none of the numbers `keys`."""
    for step in np.array(list(np.ndindex(3, 3, 3))) - 1:
        outer = ((step > 0) * _BLOCK == _NODES)[:, step != 0].all(axis=1)
        values[np.ix_(~np.isin(_keys(blocks + step), keys), outer)] = -_LEAST


def _blocks_about(boxes_m: np.ndarray, cell_m: float) -> np.ndarray:
    """Return the numbers of the blocks that boxes (k, 2, 3) m reach into."""
    low, high = np.moveaxis(np.floor(boxes_m / (_BLOCK * cell_m)).astype(np.int64), 1, 0)
    found = [
        np.stack(np.meshgrid(*map(np.arange, a, b), indexing="ij"), -1).reshape(-1, 3)
        for a, b in zip(low, high + 1, strict=True)
    ]
    return np.unique(_keys(np.concatenate(found)))


def _keys(blocks: np.ndarray) -> np.ndarray:
    x, y, z = (blocks + _HALF).astype(np.int64).T
    return np.asarray((x << (2 * _BITS)) | (y << _BITS) | z)


def _cells_of(keys: np.ndarray) -> np.ndarray:
    low = (1 << _BITS) - 1
    return np.column_stack([keys >> (2 * _BITS), (keys >> _BITS) & low, keys & low]) - _HALF
