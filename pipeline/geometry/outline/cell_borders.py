"""The borders of a mask's regions through the centres of their cells, in time and memory that grow with their length.

`cv2.findContours` needs the whole box of a mine three times; here are only the ends of its rows of true cells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pipeline.geometry.runs import runs_of
from pipeline.types import Mask


@dataclass(frozen=True)
class CellBorders:
    """Rings through the centres of border cells, column and row (k, 2) each, and the region that each belongs to.

    `is_hole` (n,) are rings round what is not free.
    """

    rings: list[np.ndarray]
    region: np.ndarray
    is_hole: np.ndarray


@dataclass(frozen=True)
class RowEnds:
    """Where rows of a mask begin and end: `key` (2 n,) is row times `width` plus column, in order.

    The cells of a row from the first of its columns to before the second are true, and so on.
    """

    key: np.ndarray
    width: int

    @classmethod
    def doubled(cls, mask: Mask) -> RowEnds:
        """Return a mask with each cell as a square of four, beyond a border of two that are not true."""
        row, start, stop = (2 + 2 * place for place in runs_of(mask))
        width = 2 * mask.shape[1] + 6
        one = np.column_stack([row * width + start, row * width + stop])
        return cls(np.sort(np.concatenate([one, one + width]), axis=None), width)

    def is_true(self, row: np.ndarray, col: np.ndarray) -> np.ndarray:
        """Return whether cells are true."""
        return np.searchsorted(self.key, row * self.width + col, "right") % 2 == 1

    def toggled(self, row: np.ndarray, col: np.ndarray) -> RowEnds:
        """Return the mask with different cells changed."""
        changed = row * self.width + col
        return RowEnds(_once(np.concatenate([self.key, changed, changed + 1])), self.width)


def fill_contacts(ends: RowEnds) -> RowEnds:
    """Return a mask in which no two true cells touch only at a corner: the four cells about such a corner are true."""
    while True:
        _, over, under = np.intersect1d(ends.key + ends.width, ends.key, assume_unique=True, return_indices=True)
        line, col = np.divmod(ends.key[under[over % 2 != under % 2]], ends.width)
        if not len(line):
            return ends
        row = np.concatenate([line - 1, line - 1, line, line])
        col = np.concatenate([col - 1, col, col - 1, col])
        row, col = np.divmod(np.unique((row * ends.width + col)[~ends.is_true(row, col)]), ends.width)
        ends = ends.toggled(row, col)


def _once(keys: np.ndarray) -> np.ndarray:
    """Return in order those keys that occur an odd number of times."""
    found, count = np.unique(keys, return_counts=True)
    return found[count % 2 == 1]


def trace_borders(ends: RowEnds) -> CellBorders:
    """Return the borders of a mask in which no two true cells touch only at a corner, as `cv2.findContours` does.

    Each corner of the cells' sides ends one straight side along a row and one along a column. Rings follow them with
    true cells on their left. They begin at their first corner, row by row, and are in the order of these.
    """
    width = ends.width
    corner = _once(np.concatenate([ends.key, ends.key + width]))
    (line, col), number = np.divmod(corner, width), np.arange(len(corner))
    across, down, by_column = number ^ 1, np.empty_like(number), np.lexsort((line, col))  # the other ends of both sides
    down[by_column] = by_column[number ^ 1]
    is_left, is_upper = across > number, line[down] > line
    # Of the true cells beside a side that at the corner.
    row = np.where(ends.is_true(line, np.where(is_left, col, col[across])), line, line - 1)
    beside_row = np.column_stack([np.where(is_left, col, col - 1), row])
    column = np.where(ends.is_true(np.where(is_upper, line, line[down]), col), col, col - 1)
    beside_column = np.column_stack([column, np.where(is_upper, line, line - 1)])
    goes_across = is_left == (row < line)
    follower = np.where(goes_across, across, down)
    came, goes = np.where(goes_across, [beside_column.T, beside_row.T], [beside_row.T, beside_column.T])
    passed = np.stack([came.T, goes.T], axis=1)
    orders = _cycles(follower)
    rings = [_without_straight(passed[order].reshape(-1, 2)) for order in orders]
    ring_of = np.empty_like(number)
    for ring, order in enumerate(orders):
        ring_of[order] = ring
    first = np.array([order[0] for order in orders], np.int64)
    is_hole = ends.is_true(line[first] - 1, col[first])
    # The ring at the left end of the cells over a hole belongs to the same region.
    hole = np.flatnonzero(is_hole)
    left = ends.key[np.searchsorted(ends.key, (line[first] - 1)[hole] * width + col[first][hole], "right") - 1]
    height = int(line.max(initial=0)) + 1
    at = np.searchsorted(col[by_column] * height + line[by_column], left % width * height + left // width, "right") - 1
    links = coo_array((np.ones(len(hole), bool), (hole, ring_of[by_column[at]])), shape=(len(rings), len(rings)))
    return CellBorders(rings, connected_components(links, directed=False)[1], is_hole)


def _cycles(follower: np.ndarray) -> list[list[int]]:
    """Return the cycles of a permutation; each begins with its lowest number, the lowest first."""
    following, seen, found = follower.tolist(), bytearray(len(follower)), []
    for start in range(len(following)):
        cycle = []
        while not seen[start]:
            seen[start] = 1
            cycle.append(start)
            start = following[start]
        if cycle:
            found.append(cycle)
    return found


def _without_straight(ring: np.ndarray) -> np.ndarray:
    """Return a ring (k, 2) of cells without those passed twice or straight; its first one stays."""
    ring = ring[(ring != np.roll(ring, -1, axis=0)).any(axis=1)]
    step = np.sign(np.roll(ring, -1, axis=0) - ring)
    turns = (step != np.roll(step, 1, axis=0)).any(axis=1)
    return ring[turns]
