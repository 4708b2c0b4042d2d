"""An octree of the free and occupied volume, and its OctoMap file format (`.bt`)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from pipeline.errors import GeometryError

_DEPTH = 16
_CENTRE = 1 << (_DEPTH - 1)  # OctoMap's key of the coordinate 0
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


def build_octree(
    free: np.ndarray,
    origin_m: np.ndarray,
    cell_m: float,
    height_m: float | np.ndarray,
    floor_m: np.ndarray | None = None,
    moved: np.ndarray | None = None,
) -> Octree:
    """Build the octree of workings extruded to a height, enclosed by one voxel of rock on all sides.

    Rock deeper than that stays unknown, as in a map made by a sensor.

    Parameters
    ----------
    free : (rows, cols) bool
        Free cells, row 0 in the south; all other cells are rock.
    origin_m : (2,), m, mine frame
        South-west corner, a whole number of cells from the mine's origin.
    cell_m : float
        Edge of a voxel.
    height_m : float, or (rows, cols) float
        Height of the workings; a voxel is free when its centre lies below it.
    floor_m : (rows, cols) float, optional
        The floor's height at each free cell; without it the floor is level at zero.
    moved : (rows, cols, 2) int, optional
        How many cells each free cell is moved east and north in plan.
    """
    at = np.nonzero(free)  # only these: a plan with gaps is nearly empty
    layers = np.maximum(1, np.round(np.broadcast_to(height_m, free.shape)[at] / cell_m)).astype(np.int64)
    shift = np.zeros((len(at[0]), 2), np.int64) if moved is None else moved[at]
    base = np.zeros(len(layers), np.int64) if floor_m is None else np.round(floor_m[at] / cell_m).astype(np.int64)
    codes, states = _voxels(free, origin_m, cell_m, layers, base, shift)
    return _merge(codes, states, cell_m)


def _require_range(first: np.ndarray, last: np.ndarray, cell_m: float) -> None:
    if first.min() < 0 or last.max() > 2 * _CENTRE:
        raise GeometryError(
            f"octree: the workings reach beyond +-{_CENTRE * cell_m:g} m, the range of 16 levels of {cell_m:g} m; "
            "use a larger compile3d.grid_cell_m"
        )


def _voxels(
    free: np.ndarray, origin_m: np.ndarray, cell_m: float, layers: np.ndarray, base: np.ndarray, shift: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the codes, in order, and states of all voxels: columns begin at the layers `base` (k,), rock is one thick.

    Each of the k free cells, row by row, is as many `layers` (k,) high, and moved by `shift` (k, 2).
    """
    if not len(layers):
        return np.zeros(0, np.int64), np.zeros(0, np.uint8)
    row, col = np.nonzero(free)
    west, south = (round(v / cell_m) for v in origin_m)
    east, north = col + west - shift[:, 0] + _CENTRE, row + south - shift[:, 1] + _CENTRE
    up, tall = base + _CENTRE, layers
    most = int(tall.max(initial=1))
    low, high = (np.array([f(v) for v in (east, north, up)]) for f in (np.min, np.max))
    _require_range(low - 1, high + np.array([2, 2, most + 2]), cell_m)
    x, y, z = (_spread(np.arange(high[axis] + most + 2)) << axis for axis in range(3))

    def stacked(j: int, i: int, some: np.ndarray) -> list[np.ndarray]:
        """Return the codes of the voxels of columns, moved j voxels to the east and i to the north."""
        plan = x[east + j] | y[north + i]
        return [plan[some & (tall > k)] | z[up[some & (tall > k)] + k] for k in range(most)]

    def ends(j: int, i: int) -> list[np.ndarray]:
        """Return the codes of the voxels below and above all columns, moved alike."""
        plan = x[east + j] | y[north + i]
        return [plan | z[up - 1], plan | z[up + tall]]

    every, is_level = np.ones(len(up), bool), (tall == most).all()
    inside = _distinct(stacked(0, 0, every))
    padded = np.pad(free, 1)
    solid = np.zeros(0, np.int64)
    for i, j in product((-1, 0, 1), repeat=2):  # one after another: most voxels are the same
        at_wall = ~padded[row + 1 + i, col + 1 + j] if is_level else every  # else beside a lower column too
        solid = _distinct([solid, *ends(j, i), *stacked(j, i, at_wall)])
    place = np.minimum(np.searchsorted(inside, solid), len(inside) - 1)
    solid = solid[inside[place] != solid]
    codes = np.concatenate([inside, solid])
    states = np.repeat(np.array([FREE, OCCUPIED], np.uint8), [len(inside), len(solid)])
    order = np.argsort(codes, kind="stable")
    return codes[order], states[order]


def _distinct(parts: list[np.ndarray]) -> np.ndarray:
    """Return codes in order, each once; by sorting, since numpy's `unique` is slow on millions of integers."""
    codes = np.concatenate(parts)
    codes.sort()
    return codes[np.append(True, codes[1:] != codes[:-1])]


def _merge(codes: np.ndarray, states: np.ndarray, cell_m: float) -> Octree:
    """Merge eight equal leaves, given by their codes in order, into their parent, level by level."""
    levels: list[tuple[np.ndarray, np.ndarray]] = []
    for _ in range(_DEPTH):
        parents = codes >> 3
        starts = np.flatnonzero(np.append(len(parents) > 0, parents[1:] != parents[:-1]))
        count = np.diff(np.append(starts, len(parents)))
        low, high = np.minimum.reduceat(states, starts), np.maximum.reduceat(states, starts)
        whole = (count == 8) & (low == high) & (high != INNER)
        kept = ~np.repeat(whole, count)
        levels.append((codes[kept], states[kept]))
        codes, states = parents[starts], np.where(whole, high, INNER).astype(np.uint8)
    levels.append((codes, states))
    return Octree(cell_m, [codes for codes, _ in levels[::-1]], [states for _, states in levels[::-1]])


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
