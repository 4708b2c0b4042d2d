"""The surface of the space that a scanned mesh is about, where its triangles cross, lie on each other, or leave holes."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np
from skimage.measure import marching_cubes

from pipeline.geometry.ray_scene import ray_scene
from pipeline.scans.meshes.winding import WindingNumber

_BLOCK = 8  # cubes along a block's side
_NODES = np.stack(np.meshgrid(*[np.arange(_BLOCK + 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
_WIDE = _BLOCK * np.sqrt(3)  # cells across a block
_MOST, _LEAST = 4.0, 0.02  # cells: values are no larger, and no smaller, as corners on nodes would be one
_STEEP = 8.0  # cells from a winding number of 0 to 1 in a hole, about
_WELD = 1e4  # parts of a cell
_LEAST_CELL_M = 0.02
_MOST_NODES, _NODES_A_CELL = 8e6, 28.5  # in all, and for each cell's area of the mesh
_TOGETHER = 200  # blocks
_BITS, _HALF = 20, 1 << 19
_FEW = np.flatnonzero((_NODES % (_BLOCK // 2) == 0).all(axis=1))  # three nodes a side


class _Field:
    """How far nodes of a grid are within the space, in cells: the distance from the mesh, and less where a hole is."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, cell_m: float) -> None:
        self._winding, self._cell_m = WindingNumber(vertices, faces), cell_m
        if self._winding.volume_m3 < 0:
            self._winding = WindingNumber(vertices, faces[:, ::-1])
        self._middle = vertices.mean(axis=0)
        self._scene = ray_scene(vertices - self._middle, faces)

    def at(self, blocks: np.ndarray) -> np.ndarray:
        """Return the values (n, 729) of the nodes of blocks (n, 3)."""
        nodes = blocks[:, None] * _BLOCK + _NODES
        places = (nodes * self._cell_m).reshape(-1, 3)
        whole = self._winding.of_mesh_and_caps(places, _columns(nodes), self._cell_m)
        to_mesh = self._scene.compute_distance((places - self._middle).astype(np.float32)).numpy() / self._cell_m
        to_caps = self._winding.to_caps_m(places) / self._cell_m
        # Away from the caps their share has no steps, and away from the mesh the whole has none: parabolas do there.
        caps = self._winding.of_caps((nodes[:, _FEW] * self._cell_m).reshape(-1, 3))
        inside = whole - _between(caps)
        own = (to_caps < _WIDE) & (to_mesh >= _WIDE)
        inside[own] = _between(whole.reshape(len(blocks), -1)[:, _FEW].reshape(-1) - caps)[own]
        own = (to_caps < _WIDE) & (to_mesh < _WIDE)
        inside[own] = whole[own] - self._winding.of_caps(places[own])
        away = inside - 0.5
        size = np.maximum(np.minimum(np.minimum(to_mesh, _MOST), _STEEP * np.abs(away)), _LEAST)
        return np.where(away < 0, -size, size).reshape(len(blocks), -1)


def cell_of(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Return the size of the grid's cells for a mesh, m: its median edge, or what keeps nodes to eight million."""
    corners = vertices[faces]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    return max(_LEAST_CELL_M, float(np.median(edges)), float(np.sqrt(_NODES_A_CELL * area / _MOST_NODES)))


def rebuilt(vertices: np.ndarray, faces: np.ndarray, cell_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the surface of a mesh's space, found on a grid: no facet of it crosses another, and it has no hole.

    Free is where the winding number is more than a half: triangles that cross, or stand twice, count as one wall, and a
    hole is closed by a skin between its borders. The surface is followed from block to block.

    Parameters
    ----------
    vertices, faces : (n, 3) float64 m, (m, 3) int
        Turned alike.
    cell_m : float
        What is thinner is lost.

    Returns
    -------
    (k, 3) float64 m, (j, 3) int
    """
    field, found = _Field(vertices, faces, cell_m), _Surface()
    left, known = _blocks_with(vertices[faces], cell_m), np.zeros(0, np.int64)
    while len(left):
        known = np.union1d(known, left)
        beside = [known[:0]]
        for blocks, values in _in_parts(field, left):
            beside += [_keys(block + step) for block, step in found.add(blocks, values)]
        left = np.setdiff1d(np.concatenate(beside), known)
    return found.welded(cell_m)


def rebuilt_within(
    vertices: np.ndarray, faces: np.ndarray, cell_m: float, boxes_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the surface of what of a mesh's space is in the blocks that boxes (k, 2, 3) m reach into.

    Where these blocks end so does the space, within half a hundredth of a cell.
    """
    field, found = _Field(vertices, faces, cell_m), _Surface()
    known = _blocks_with(boxes_m + np.array([[-cell_m], [cell_m]]), cell_m)
    for blocks, values in _in_parts(field, known):
        for step in np.ndindex(3, 3, 3):
            ends = ~np.isin(_keys(blocks + np.array(step) - 1), known)
            outer = (_NODES == (np.array(step) - 1 > 0) * _BLOCK)[:, np.array(step) != 1].all(axis=1)
            values[np.ix_(ends, outer)] = -_LEAST
        deque(found.add(blocks, values), maxlen=0)
    return found.welded(cell_m)


def _in_parts(field: _Field, keys: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield blocks (n, 3) and the values (n, 729) of their nodes."""
    for k in range(0, len(keys), _TOGETHER):
        blocks = _cells_of(keys[k : k + _TOGETHER])
        yield blocks, field.at(blocks)


class _Surface:
    """Triangles of marching cubes, block by block."""

    def __init__(self) -> None:
        self._corners, self._faces, self._count = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0

    def add(self, blocks: np.ndarray, values: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Add the surface in blocks (n, 3); yield each with the steps (k, 3) to blocks that it goes on in."""
        for block, own in zip(blocks, values, strict=True):
            cube = own.reshape((_BLOCK + 1,) * 3)
            if cube.min() < 0 < cube.max():
                corners, faces, _, _ = marching_cubes(cube, 0.0, gradient_direction="ascent")
                self._corners.append(corners + block * _BLOCK)
                self._faces.append(faces + self._count)
                self._count += len(corners)
                yield block, _sides_met(corners)

    def welded(self, cell_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Return all of it, m: corners of neighbouring blocks are one."""
        every = np.concatenate(self._corners)
        rounded = np.round(every * _WELD).astype(np.int64)
        _, first, number = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
        return every[first] * cell_m, number.reshape(-1)[np.concatenate(self._faces)]


def _sides_met(corners: np.ndarray) -> np.ndarray:
    """Return the steps (k, 3) to the blocks that a surface in a block goes on in."""
    met = [axis * way for axis in np.eye(3, dtype=int) for way in (-1, 1)]
    low, high = corners.min(axis=0) == 0, corners.max(axis=0) == _BLOCK
    kept = [step for step in met if (low if step.sum() < 0 else high)[np.abs(step).argmax()]]
    return np.array(kept, int).reshape(-1, 3)


def _blocks_with(corners: np.ndarray, cell_m: float) -> np.ndarray:
    """Return the numbers of the blocks that the boxes of triangles (m, 3, 3) m reach into."""
    side = _BLOCK * cell_m
    low, high = (np.floor(pick(axis=1) / side).astype(np.int64) for pick in (corners.min, corners.max))
    shape = high - low + 1
    count = shape.prod(axis=1)
    row = np.repeat(np.arange(len(low)), count)
    at = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    x, y = at // (shape[row, 1] * shape[row, 2]), at // shape[row, 2] % shape[row, 1]
    return np.unique(_keys(low[row] + np.column_stack([x, y, at % shape[row, 2]])))


def _keys(blocks: np.ndarray) -> np.ndarray:
    x, y, z = (blocks + _HALF).astype(np.int64).T
    return np.asarray((x << (2 * _BITS)) | (y << _BITS) | z)


def _cells_of(keys: np.ndarray) -> np.ndarray:
    low = (1 << _BITS) - 1
    return np.column_stack([keys >> (2 * _BITS), (keys >> _BITS) & low, keys & low]) - _HALF


def _columns(nodes: np.ndarray) -> np.ndarray:
    """Return the number (n,) of the vertical line that each node (..., 3) is on."""
    x, y = (nodes[..., k].reshape(-1) + _HALF * _BLOCK for k in (0, 1))
    return np.asarray(x << 2 * _BITS | y)


def _between(few: np.ndarray) -> np.ndarray:
    """Return the values at all nodes of blocks (n * 729,), by parabolas between three a side (n * 27,)."""
    x = np.arange(_BLOCK + 1) / _BLOCK
    share = np.column_stack([(2 * x - 1) * (x - 1), 4 * x * (1 - x), x * (2 * x - 1)])
    found = np.einsum("nabc,ia,jb,kc->nijk", few.reshape(-1, 3, 3, 3), share, share, share, optimize=True)
    return np.asarray(found.reshape(-1))
