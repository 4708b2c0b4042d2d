"""What a closed mesh that crosses itself encloses, found again on a grid in boxes about where it does."""

from __future__ import annotations

import numpy as np
from skimage.measure import marching_cubes

from pipeline.geometry.facets.separation import boxes_of
from pipeline.geometry.nearest_facets import NearestFacets
from pipeline.scans.meshes.winding import WindingNumber

_BLOCK = 8  # cubes along a block's side
_NODES = np.stack(np.meshgrid(*[np.arange(_BLOCK + 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
_MOST, _LEAST = 4.0, 0.02  # cells: distances are no larger, and no smaller, as corners on nodes would be one
_AROUND = np.array(list(np.ndindex(3, 3, 3))) - 1
_BESIDE = 0.01  # of a cell, about facets: one between two blocks is of both
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
    winding, facets = WindingNumber(vertices, faces), NearestFacets(vertices, faces)
    keys = _blocks_about(boxes_m + np.array([[-cell_m], [cell_m]]), cell_m)
    held = _with_surface(keys, vertices[faces], cell_m)
    corners, triangles, count = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    for k in range(0, len(held), _TOGETHER):
        blocks = _cells_of(held[k : k + _TOGETHER])
        nodes = (blocks[:, None] * _BLOCK + _NODES).reshape(-1, 3)
        places = nodes * cell_m
        inside = (
            winding.at(places, (nodes[:, 0] + (_HALF << 3) << 2 * _BITS) | (nodes[:, 1] + (_HALF << 3)), cell_m) > 0
        )
        far = np.clip(facets.query(places).distance_m / cell_m, _LEAST, _MOST)
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


def _with_surface(keys: np.ndarray, corners: np.ndarray, cell_m: float) -> np.ndarray:
    """Return those of the blocks `keys` that triangles (f, 3, 3) m may reach into, and those beside no other block.

    The rest are in the space or out of it as a whole.
    """
    blocks = _cells_of(keys)
    low, high = boxes_of(corners)
    low, high = low - _BESIDE * cell_m, high + _BESIDE * cell_m
    least, most = blocks.min(axis=0) * _BLOCK * cell_m, (blocks.max(axis=0) + 1) * _BLOCK * cell_m
    meets = ((low <= most) & (high >= least)).all(axis=1)
    about = np.clip(np.stack([low, high], axis=1)[meets], least, most)
    is_held = np.isin(keys, _blocks_about(about, cell_m))
    for step in _AROUND:
        is_held |= ~np.isin(_keys(blocks + step), keys)
    return keys[is_held]


def _end(values: np.ndarray, blocks: np.ndarray, keys: np.ndarray) -> None:
    """Set values (n, 729) of blocks (n, 3) outside at nodes beside blocks that are none of the numbers `keys`."""
    for step in _AROUND:
        outer = ((step > 0) * _BLOCK == _NODES)[:, step != 0].all(axis=1)
        values[np.ix_(~np.isin(_keys(blocks + step), keys), outer)] = -_LEAST


def _blocks_about(boxes_m: np.ndarray, cell_m: float) -> np.ndarray:
    """Return the numbers of the blocks that boxes (k, 2, 3) m reach into."""
    low, high = np.moveaxis(np.floor(boxes_m / (_BLOCK * cell_m)).astype(np.int64), 1, 0)
    _, north, up = (high - low + 1).T
    count = (high - low + 1).prod(axis=1)
    own = np.repeat(np.arange(len(low)), count)
    number = np.arange(len(own)) - np.repeat(np.cumsum(count) - count, count)
    steps = np.column_stack([number // (north * up)[own], number // up[own] % north[own], number % up[own]])
    return np.unique(_keys(low[own] + steps))


def _keys(blocks: np.ndarray) -> np.ndarray:
    x, y, z = (blocks + _HALF).astype(np.int64).T
    return np.asarray((x << (2 * _BITS)) | (y << _BITS) | z)


def _cells_of(keys: np.ndarray) -> np.ndarray:
    low = (1 << _BITS) - 1
    return np.column_stack([keys >> (2 * _BITS), (keys >> _BITS) & low, keys & low]) - _HALF
