"""An octree of the free and occupied volume, and its OctoMap file format (`.bt`)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.ndimage import binary_dilation

from pipeline.errors import GeometryError, InputError

_DEPTH = 16
_CENTRE = 1 << (_DEPTH - 1)  # OctoMap's key of the coordinate 0
UNKNOWN, FREE, OCCUPIED, INNER = 0, 1, 2, 3  # OctoMap's two bits for a child: 00, 10, 01, 11 (low bit first)


# Shifts and masks that put two zero bits between each two bits of an integer, 21 bits at first.
_FULL = 0x1FFFFF
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

    `keys[k]` are the sorted node keys of level k, (n, 3) ints (x, y, z); `states[k]` their states. A FREE or OCCUPIED
    node is a leaf; space without a node is UNKNOWN. Coordinates are in the mine frame.
    """

    resolution_m: float
    keys: list[np.ndarray]
    states: list[np.ndarray]

    def query(self, points: np.ndarray) -> np.ndarray:
        """Return the state at each of (n, 3) points, m, mine frame: UNKNOWN, FREE or OCCUPIED."""
        voxel = np.floor(np.asarray(points) / self.resolution_m).astype(np.int64) + _CENTRE
        states = np.full(len(voxel), UNKNOWN, dtype=np.uint8)
        for level in range(_DEPTH + 1):
            if len(self.keys[level]):
                codes, wanted = _code(self.keys[level]), _code(voxel >> (_DEPTH - level))
                at = np.minimum(np.searchsorted(codes, wanted), len(codes) - 1)
                state = self.states[level][at]
                leaf = (codes[at] == wanted) & (state != INNER)
                states[leaf] = state[leaf]
        return states

    @property
    def nodes(self) -> int:
        """Return the number of nodes: inner nodes and leaves."""
        return sum(len(k) for k in self.keys)

    def volume_m3(self, state: int) -> float:
        """Return the volume of all leaves in one state, m3."""
        widths = [self.resolution_m * 2 ** (_DEPTH - k) for k in range(_DEPTH + 1)]
        return float(sum(np.count_nonzero(s == state) * w**3 for s, w in zip(self.states, widths, strict=True)))


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
    height_m : float, or (rows, cols) float with `floor_m`
        Height of the workings; a voxel is free when its centre lies below it.
    floor_m : (rows, cols) float, optional
        The floor's height at each free cell; without it the floor is level at zero.
    moved : (rows, cols, 2) int, optional
        How many cells each free cell is moved east and north in plan.
    """
    if floor_m is not None:
        at = np.nonzero(free)  # only these: a plan of many sheets is nearly empty
        layers = np.maximum(1, np.round(np.broadcast_to(height_m, free.shape)[at] / cell_m)).astype(np.int64)
        shift = np.zeros((len(at[0]), 2), np.int64) if moved is None else moved[at]
        return _follow(free, origin_m, cell_m, layers, np.round(floor_m[at] / cell_m).astype(np.int64), shift)
    number = max(1, round(float(np.max(height_m)) / cell_m))
    padded = np.pad(free, 1)
    shell = binary_dilation(padded, np.ones((3, 3), dtype=bool))
    column = np.where(padded, FREE, np.where(shell, OCCUPIED, UNKNOWN)).astype(np.uint8)
    closed = np.where(shell, OCCUPIED, UNKNOWN).astype(np.uint8)
    volume = np.stack([closed, *[column] * number, closed])
    first = np.array([round(origin_m[0] / cell_m) - 1, round(origin_m[1] / cell_m) - 1, -1]) + _CENTRE
    last = first + volume.shape[::-1]
    _require_range(first, last, cell_m)
    return _grow(volume, first, cell_m)


def _require_range(first: np.ndarray, last: np.ndarray, cell_m: float) -> None:
    if first.min() < 0 or last.max() > 2 * _CENTRE:
        raise GeometryError(
            f"octree: the workings reach beyond +-{_CENTRE * cell_m:g} m, the range of 16 levels of {cell_m:g} m; "
            "use a larger compile3d.grid_cell_m"
        )


def _follow(
    free: np.ndarray, origin_m: np.ndarray, cell_m: float, layers: np.ndarray, base: np.ndarray, shift: np.ndarray
) -> Octree:
    """Build the octree of workings whose columns begin at the layers `base` (k,); rock is one voxel thick.

    Each of the k free cells, row by row, is as many `layers` (k,) high, and moved by `shift` (k, 2).
    """
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
    return _merge(codes[order], states[order], cell_m)


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
        starts = np.flatnonzero(np.append(True, parents[1:] != parents[:-1]))
        count = np.diff(np.append(starts, len(parents)))
        low, high = np.minimum.reduceat(states, starts), np.maximum.reduceat(states, starts)
        whole = (count == 8) & (low == high) & (high != INNER)
        kept = ~np.repeat(whole, count)
        levels.append((_keys(codes[kept]), states[kept]))
        codes, states = parents[starts], np.where(whole, high, INNER).astype(np.uint8)
    levels.append((_keys(codes), states))
    return Octree(cell_m, [keys for keys, _ in levels[::-1]], [states for _, states in levels[::-1]])


def _grow(volume: np.ndarray, first: np.ndarray, cell_m: float) -> Octree:
    """Merge eight equal leaves into their parent, level by level; `volume` is (z, y, x), `first` its corner's key."""
    levels: list[tuple[np.ndarray, np.ndarray]] = []
    for _ in range(_DEPTH):
        pad = [(int(first[axis]) & 1, (int(first[axis]) + volume.shape[2 - axis]) & 1) for axis in (2, 1, 0)]
        volume, first = np.pad(volume, pad), first - (first & 1)
        nz, ny, nx = (n // 2 for n in volume.shape)
        eight = volume.reshape(nz, 2, ny, 2, nx, 2)
        low, high = eight.min(axis=(1, 3, 5)), eight.max(axis=(1, 3, 5))
        parent = np.where((low == high) & (high != INNER), high, INNER).astype(np.uint8)
        kept = (parent == INNER).repeat(2, axis=0).repeat(2, axis=1).repeat(2, axis=2) & (volume != UNKNOWN)
        levels.append((np.argwhere(kept)[:, ::-1] + first, volume[kept]))
        volume, first = parent, first >> 1
    levels.append((np.argwhere(volume != UNKNOWN)[:, ::-1] + first, volume[volume != UNKNOWN]))
    ordered = [(keys[at], states[at]) for keys, states in levels[::-1] for at in (np.argsort(_code(keys)),)]
    return Octree(cell_m, [keys for keys, _ in ordered], [states for _, states in ordered])


def _code(keys: np.ndarray) -> np.ndarray:
    """Interleave (x, y, z) into a Morton code, x lowest: OctoMap's order of children."""
    code = np.zeros(len(keys), dtype=np.int64)
    for axis in range(3):
        code |= _spread(keys[:, axis].astype(np.int64)) << axis
    return code


def _spread(v: np.ndarray) -> np.ndarray:
    """Return integers with two zero bits between each two bits."""
    for shift, pattern in _STEPS:
        v = (v | (v << shift)) & pattern
    return v


def _keys(codes: np.ndarray) -> np.ndarray:
    """Return the keys (n, 3) of Morton codes (n,)."""
    keys = np.empty((len(codes), 3), np.int64)
    for axis in range(3):
        v = (codes >> axis) & _STEPS[-1][1]
        for (shift, _), pattern in zip(_STEPS[::-1], [*(p for _, p in _STEPS[-2::-1]), _FULL], strict=True):
            v = (v | (v >> shift)) & pattern
        keys[:, axis] = v
    return keys


def to_bt(tree: Octree) -> bytes:
    """Serialise to OctoMap's binary stream: two bits for each child, nodes in depth-first order.

    References
    ----------
    Hornung et al. 2013, doi:10.1007/s10514-012-9321-0; file format of OctoMap's `OcTree::writeBinary`.
    """
    inner_codes, words = [], []
    for level in range(_DEPTH):
        inner = tree.keys[level][tree.states[level] == INNER]
        codes, children = _code(inner), tree.keys[level + 1]
        child_codes = _code(children)
        parent = np.searchsorted(codes, child_codes >> 3)
        word = np.zeros(len(inner), dtype=np.uint16)
        bits = tree.states[level + 1].astype(np.uint16) << (2 * (child_codes & 7)).astype(np.uint16)
        np.bitwise_or.at(word, parent, bits)
        # A depth-first walk visits nodes by the code of their first voxel, a parent before its first child.
        inner_codes.append((codes << (3 * (_DEPTH - level)), np.full(len(inner), level)))
        words.append(word)
    first = np.concatenate([c for c, _ in inner_codes])
    order = np.lexsort((np.concatenate([k for _, k in inner_codes]), first))
    header = f"# Octomap OcTree binary file\nid OcTree\nsize {tree.nodes}\nres {tree.resolution_m:.6g}\ndata\n"
    return header.encode() + np.concatenate(words)[order].astype("<u2").tobytes()


def from_bt(data: bytes) -> Octree:
    """Read OctoMap's binary stream.

    Raises
    ------
    InputError
        If the header is not that of an OctoMap binary tree, or the stream is truncated.
    """
    head, separator, body = data.partition(b"\ndata\n")
    fields = dict(line.split(" ", 1) for line in head.decode("ascii", "replace").splitlines()[1:] if " " in line)
    if not head.startswith(b"# Octomap OcTree binary file") or not separator or fields.get("id") != "OcTree":
        raise InputError("octree: not an OctoMap binary file (no '# Octomap OcTree binary file' header)")
    words = np.frombuffer(body[: len(body) // 2 * 2], dtype="<u2")
    keys: list[list[tuple[int, int, int]]] = [[] for _ in range(_DEPTH + 1)]
    states: list[list[int]] = [[] for _ in range(_DEPTH + 1)]
    stack, read = [], 0
    if len(words) or fields.get("size") != "0":  # a tree that holds only unknown space has no root
        keys[0].append((0, 0, 0))
        states[0].append(INNER)
        stack.append((0, (0, 0, 0)))
    while stack:
        level, (x, y, z) = stack.pop()
        if read >= len(words) or level >= _DEPTH:
            raise InputError(
                f"octree: the stream ends, or the tree is too deep, at node {read} of {fields.get('size')}"
            )
        word, inner = int(words[read]), []
        read += 1
        for child in range(8):
            state = (word >> (2 * child)) & 3
            if state != UNKNOWN:
                key = (2 * x + (child & 1), 2 * y + (child >> 1 & 1), 2 * z + (child >> 2))
                keys[level + 1].append(key)
                states[level + 1].append(state)
                if state == INNER:
                    inner.append((level + 1, key))
        stack.extend(reversed(inner))
    arrays = [np.array(k, dtype=np.int64).reshape(-1, 3) for k in keys]
    order = [np.argsort(_code(k)) for k in arrays]
    return Octree(
        float(fields["res"]),
        [k[o] for k, o in zip(arrays, order, strict=True)],
        [np.array(s, dtype=np.uint8)[o] for s, o in zip(states, order, strict=True)],
    )
