"""An octree of the free and occupied volume, and its OctoMap file format (`.bt`)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from pipeline.errors import GeometryError

_DEPTH = 16
_CENTRE = 1 << (_DEPTH - 1)  # OctoMap's key of the coordinate 0
_BLOCK = 8  # levels of a block of the plan that is built at once
UNKNOWN, FREE, OCCUPIED, INNER = 0, 1, 2, 3  # OctoMap's two bits for a child: 00, 10, 01, 11 (low bit first)

# Shifts and masks that put two zero bits between each two bits of an integer, 21 bits at first.
_STEPS = (
    (32, 0x1F00000000FFFF),
    (16, 0x1F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)


@dataclass(frozen=True)
class Octree:
    """A tree of depth 16 over cubes of `resolution_m`; level k holds nodes 2 ** (16 - k) voxels wide.

    `codes[k]` are the sorted Morton codes of the nodes of level k, x lowest, in OctoMap's order of children;
    `states[k]` are their states. A FREE or OCCUPIED node is a leaf; space without a node is UNKNOWN. Coordinates are in
    the mine frame.
    """

    resolution_m: float
    codes: list[np.ndarray]
    states: list[np.ndarray]

    @property
    def nodes(self) -> int:
        """Return the number of nodes: inner nodes and leaves."""
        return sum(map(len, self.codes))


@dataclass(frozen=True)
class Columns:
    """Free columns of voxels (k,) each: keys east and north, the key of the lowest free voxel, how many are free.

    A key is a coordinate in voxels plus half the tree's width. Columns may lie over each other.
    """

    east: np.ndarray
    north: np.ndarray
    base: np.ndarray
    layers: np.ndarray

    @classmethod
    def of_cells(
        cls,
        cells: np.ndarray,
        origin_m: np.ndarray,
        cell_m: float,
        height_m: float | np.ndarray,
        floor_m: float | np.ndarray = 0.0,
    ) -> Columns:
        """Return the columns over free cells.

        Parameters
        ----------
        cells : (k, 2) int
            Row and column; row 0 is in the south.
        origin_m : (2,), m, mine frame
            South-west corner of the cells, a whole number of cells from the mine's origin.
        cell_m : float
            Edge of a voxel.
        height_m, floor_m : float or (k,) m
            A voxel is free when its centre lies above the floor and below the height over it.
        """
        row, col = cells.T
        west, south = (round(v / cell_m) for v in origin_m)
        layers, base = (np.round(np.broadcast_to(v, row.shape) / cell_m).astype(np.int64) for v in (height_m, floor_m))
        return cls(col + west + _CENTRE, row + south + _CENTRE, base + _CENTRE, np.maximum(1, layers))

    def __len__(self) -> int:
        return len(self.east)

    def some(self, which: np.ndarray) -> Columns:
        """Return some of the columns."""
        return Columns(self.east[which], self.north[which], self.base[which], self.layers[which])


def build_octree(columns: Columns, cell_m: float) -> Octree:
    """Build the octree of free columns, enclosed by one voxel of rock on all sides.

    Rock deeper than that stays unknown, as in a map made by a sensor. Blocks of the plan are built one after another,
    so that memory holds the leaves of the whole and the voxels of a block.

    Raises
    ------
    GeometryError
        If the columns reach beyond the range of 16 levels.
    """
    _require_range(columns, cell_m)
    blocks = [_merge(*_voxels(near, east, north), _BLOCK) for east, north, near in _blocks(columns)]
    levels = [_sorted([block[k] for block in blocks]) for k in range(_BLOCK + 1)]
    levels += _merge(*levels.pop(), _DEPTH - _BLOCK)
    return Octree(cell_m, [codes for codes, _ in levels[::-1]], [states for _, states in levels[::-1]])


def _require_range(columns: Columns, cell_m: float) -> None:
    keys = [(v.min(initial=_CENTRE), v.max(initial=_CENTRE)) for v in (columns.east, columns.north)]
    keys.append((columns.base.min(initial=_CENTRE), (columns.base + columns.layers).max(initial=_CENTRE)))
    if min(low for low, _ in keys) < 1 or max(high for _, high in keys) > 2 * _CENTRE - 2:
        raise GeometryError(
            f"octree: the workings reach beyond +-{_CENTRE * cell_m:g} m, the range of 16 levels of {cell_m:g} m; "
            "use a larger compile3d.grid_cell_m"
        )


def _blocks(columns: Columns) -> Iterator[tuple[int, int, Columns]]:
    """Return east and north of each block that holds free space or its rock, and the columns in and beside it."""
    number = np.concatenate(
        [
            (columns.east + i >> _BLOCK) << _DEPTH | columns.north + j >> _BLOCK
            for i, j in product((-1, 1), repeat=2)  # a column's rock is at most in these
        ]
    )
    order = np.argsort(number, kind="stable")
    for some in np.split(order, np.flatnonzero(np.diff(number[order])) + 1) if len(order) else []:
        block = int(number[some[0]])
        yield block >> _DEPTH, block & ((1 << _DEPTH) - 1), columns.some(np.unique(some % len(columns)))


def _voxels(columns: Columns, east: int, north: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the codes, in order, and the states of a block's voxels; rock is one voxel thick."""
    low, high = int(columns.base.min(initial=_CENTRE)) - 1, int((columns.base + columns.layers).max(initial=_CENTRE))
    z = _spread(np.arange(low, high + 1)) << 2
    order = np.lexsort((columns.base, columns.north, columns.east))
    columns = columns.some(order)
    keys = _places(columns.east, columns.north, columns.base)

    def stacked(i: int, j: int, base: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return the codes from one height to before another of columns moved i voxels to the east, j to the north."""
        to_east, to_north = columns.east + i, columns.north + j
        some = (to_east >> _BLOCK == east) & (to_north >> _BLOCK == north) & (end > base)
        count = (end - base)[some]
        up = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + np.repeat(base[some], count)
        return np.repeat(_spread(to_east[some]) | _spread(to_north[some]) << 1, count) | z[up - low]

    inside = _distinct(stacked(0, 0, columns.base, columns.base + columns.layers))
    rock = []
    below, above = columns.base - 1, columns.base + columns.layers + 1
    for i, j in product((-1, 0, 1), repeat=2):
        # The column there that begins highest below this one's end: what both have is free.
        at = np.searchsorted(keys, _places(columns.east + i, columns.north + j, above), "right") - 1
        there = (columns.east[at] == columns.east + i) & (columns.north[at] == columns.north + j)
        begins = np.where(there, np.clip(columns.base[at], below, above), above)
        ends = np.where(there, np.clip(columns.base[at] + columns.layers[at], begins, above), above)
        rock += [stacked(i, j, below, begins), stacked(i, j, ends, above)]
    solid = _distinct(np.concatenate(rock))
    place = np.minimum(np.searchsorted(inside, solid), len(inside) - 1)
    solid = solid[inside[place] != solid] if len(inside) else solid
    return _sorted([(inside, np.full(len(inside), FREE, np.uint8)), (solid, np.full(len(solid), OCCUPIED, np.uint8))])


def _places(east: np.ndarray, north: np.ndarray, base: np.ndarray) -> np.ndarray:
    """Return a number for each voxel, in the order of the keys."""
    return (east << _DEPTH + 1 | north) << _DEPTH + 1 | base


def _sorted(parts: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Return codes of several parts in order, and their states."""
    codes = np.concatenate([np.zeros(0, np.int64), *(codes for codes, _ in parts)])
    states = np.concatenate([np.zeros(0, np.uint8), *(states for _, states in parts)])
    order = np.argsort(codes, kind="stable")
    return codes[order], states[order]


def _distinct(codes: np.ndarray) -> np.ndarray:
    """Return codes in order, each once; by sorting, since numpy's `unique` is slow on millions of integers."""
    codes = np.sort(codes)
    return codes[np.append(True, codes[1:] != codes[:-1])] if len(codes) else codes


def _merge(codes: np.ndarray, states: np.ndarray, levels: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Merge eight equal leaves, given by their codes in order, into their parent; return codes and states by level."""
    found = []
    for _ in range(levels):
        parents = codes >> 3
        starts = np.flatnonzero(np.append(len(parents) > 0, parents[1:] != parents[:-1]))
        count = np.diff(np.append(starts, len(parents)))
        low, high = np.minimum.reduceat(states, starts), np.maximum.reduceat(states, starts)
        whole = (count == 8) & (low == high) & (high != INNER)
        kept = ~np.repeat(whole, count)
        found.append((codes[kept], states[kept]))
        codes, states = parents[starts], np.where(whole, high, INNER).astype(np.uint8)
    return [*found, (codes, states)]


def _spread(v: np.ndarray) -> np.ndarray:
    """Return integers with two zero bits between each two bits."""
    for shift, pattern in _STEPS:
        v = (v | (v << shift)) & pattern
    return v


def to_bt(tree: Octree) -> bytes:
    """Serialise to OctoMap's binary stream: two bits for each child, nodes in depth-first order.

    References
    ----------
    Hornung et al. 2013, doi:10.1007/s10514-012-9321-0; file format of OctoMap's `OcTree::writeBinary`.
    """
    inner_codes, words = [], []
    for level in range(_DEPTH):
        codes, child_codes = tree.codes[level][tree.states[level] == INNER], tree.codes[level + 1]
        parent = np.searchsorted(codes, child_codes >> 3)
        word = np.zeros(len(codes), dtype=np.uint16)
        bits = tree.states[level + 1].astype(np.uint16) << (2 * (child_codes & 7)).astype(np.uint16)
        np.bitwise_or.at(word, parent, bits)
        # A depth-first walk visits nodes by the code of their first voxel, a parent before its first child.
        inner_codes.append((codes << (3 * (_DEPTH - level)), np.full(len(codes), level)))
        words.append(word)
    first = np.concatenate([c for c, _ in inner_codes])
    order = np.lexsort((np.concatenate([k for _, k in inner_codes]), first))
    header = f"# Octomap OcTree binary file\nid OcTree\nsize {tree.nodes}\nres {tree.resolution_m:.6g}\ndata\n"
    return header.encode() + np.concatenate(words)[order].astype("<u2").tobytes()
