"""Sets of voxels: sorted numbers, each of one place of a grid. A mine fills a thousandth of the box about it."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

_BITS = 20
_HALF = 1 << (_BITS - 1)
REACH = _HALF - 1000  # voxels from the origin to either side
STEPS = np.array([step for step in itertools.product((-1, 0, 1), repeat=3) if any(step)])
SIDES = np.array([step for step in STEPS if np.abs(step).sum() == 1])


def keys_of(cells: np.ndarray) -> np.ndarray:
    """Return the number (n,) of each cell (n, 3) int64."""
    x, y, z = (cells + _HALF).astype(np.int64).T
    return np.asarray((x << (2 * _BITS)) | (y << _BITS) | z)


def cells_of_keys(keys: np.ndarray) -> np.ndarray:
    """Return the cells (n, 3) of numbers (n,)."""
    low = (1 << _BITS) - 1
    return np.column_stack([keys >> (2 * _BITS), (keys >> _BITS) & low, keys & low]) - _HALF


def offsets_of(steps: np.ndarray) -> np.ndarray:
    """Return by how much a step (k, 3) changes a number."""
    return np.asarray(steps @ np.array([1 << (2 * _BITS), 1 << _BITS, 1], np.int64))


def cells_at(points: np.ndarray, size_m: float) -> np.ndarray:
    """Return the cells (n, 3) that points (n, 3) m lie in; cell 0 begins at 0."""
    return np.floor(points / size_m).astype(np.int64)


def is_in(keys: np.ndarray, found: np.ndarray) -> np.ndarray:
    """Return which numbers are in a sorted set."""
    if not len(found):
        return np.zeros(keys.shape, bool)
    return np.asarray(found[np.minimum(np.searchsorted(found, keys), len(found) - 1)] == keys)


def sorted_once(keys: np.ndarray) -> np.ndarray:
    """Return the set of numbers (n,): sorted runs are merged, which is far faster than hashing as `np.unique` does."""
    merged = np.sort(keys, kind="stable")
    return np.asarray(merged[np.concatenate([[True], merged[1:] != merged[:-1]])[: len(merged)]])


def grown(keys: np.ndarray, times: int = 1) -> np.ndarray:
    """Return a set with its 26 neighbours, along one axis after the other."""
    for _ in range(times):
        for offset in offsets_of(np.eye(3, dtype=np.int64)):
            keys = sorted_once(np.concatenate([keys - offset, keys, keys + offset]))
    return keys


def components_of(keys: np.ndarray, reach: int = 1) -> np.ndarray:
    """Return the number (n,) of the component of each voxel of a set; voxels within `reach` steps are neighbours."""
    steps = np.array(list(itertools.product(range(-reach, reach + 1), repeat=3)))
    offsets = offsets_of(steps)
    ends = []
    for offset in offsets[offsets > 0]:
        at = np.minimum(np.searchsorted(keys, keys + offset), len(keys) - 1)
        one = np.flatnonzero(keys[at] == keys + offset)
        ends.append(np.column_stack([one, at[one]]))
    pairs = np.concatenate(ends) if ends else np.zeros((0, 2), int)
    graph = coo_matrix((np.ones(len(pairs), np.int8), pairs.T), (len(keys),) * 2)
    return np.asarray(connected_components(graph, directed=False)[1])
