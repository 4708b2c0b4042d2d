"""The cells of a volume that a robot can reach, and which its beams have seen."""

from __future__ import annotations

import numpy as np

from minexplore.floors.volume_arrays import FloorSpans
from minexplore.sensing.coverage import cut_at_lines

_APART_M = 1.0  # floors of one square that are so far apart in height are two cells: no robot fits between them
_NONE, _BY_HEIGHT = -1, -2  # instead of a square's cell
_BESIDE_M = 0.3  # a cell is 2 m wide: its floor rises within it


class VolumeGrid:
    """Cells of a volume, which are squares seen from above, and in each the floors over each other.

    Cell k is the square from `origin_m` + (col, row) * cell to the next corner, between `low_m` and `high_m`. All cells
    are reachable; they are numbered by square, and in a square from the lowest.
    """

    def __init__(self, spans: FloorSpans, standing: np.ndarray, cell_m: float) -> None:
        """Take the spans that a robot reaches, a mask (s,)."""
        self.cell_m = cell_m
        self.origin_m = np.floor(spans.origin_m / cell_m) * cell_m
        places = spans.places_m[standing]
        at = np.floor((places[:, :2] - self.origin_m) / cell_m).astype(int)
        self.shape = int(at[:, 1].max()) + 1, int(at[:, 0].max()) + 1  # rows and columns of squares
        square, floor = at[:, 1] * self.shape[1] + at[:, 0], places[:, 2]
        order = np.lexsort([floor, square])
        square, floor = square[order], floor[order]
        new = np.append(True, (np.diff(square) != 0) | (np.diff(floor) > _APART_M))
        first = np.flatnonzero(new)
        self.total = len(first)
        self.reachable = np.ones(self.total, bool)
        self.low_m = floor[first] - _BESIDE_M
        self.high_m = np.maximum.reduceat(floor + spans.headroom_m[standing][order], first) + _BESIDE_M
        self.storey = spans.storey[standing][order][first]
        self.square = square[first]
        self._first = np.searchsorted(self.square, np.arange(self.shape[0] * self.shape[1] + 1)).astype(np.int32)
        count = np.diff(self._first)[self.square]
        number = np.arange(self.total)[:, None] + np.arange(int(count.max()))
        own = self._first[self.square, None] + count[:, None] > number
        # Of each cell and those over it in its square, inf beyond the last.
        self._lows_m = np.where(own, self.low_m[np.minimum(number, self.total - 1)], np.inf)
        self._cell_at = self._cells_of_squares(spans)

    def _cells_of_squares(self, spans: FloorSpans) -> np.ndarray:
        """Return the one cell of each square that holds all of its free space, `_NONE`, or `_BY_HEIGHT`."""
        found = np.where(np.diff(self._first) == 0, _NONE, self._first[:-1])
        at = np.floor((spans.places_m[:, :2] - self.origin_m) / self.cell_m).astype(int)
        inside = ((at >= 0) & (at < self.shape[::-1])).all(axis=1)
        square = (at[:, 1] * self.shape[1] + at[:, 0])[inside]
        low, top = spans.floor_m[inside], (spans.floor_m + spans.headroom_m)[inside]
        cell = np.maximum(found[square], 0)
        beyond = (found[square] >= 0) & ((low < self.low_m[cell]) | (top > self.high_m[cell]))
        found[square[beyond]] = _BY_HEIGHT
        found[np.diff(self._first) > 1] = _BY_HEIGHT
        return found

    def cells_crossed(
        self, starts_m: np.ndarray, ends_m: np.ndarray, longest_m: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return ray numbers and cells that segments (n, 3), or (1, 3), to (n, 3) m pass through.

        Each segment, no longer than `longest_m`, is cut at every grid line it crosses, and each piece names the cell
        whose floor is the next under its middle, if the middle is under that cell's roof. Heights are asked for only in
        squares whose free space is more than one cell.
        """
        piece, at, middle = cut_at_lines(self.origin_m, self.cell_m, starts_m[:, :2], ends_m[:, :2], longest_m)
        rows, cols = self.shape
        col, row = at[:, 0], at[:, 1]
        # Seen as a number without sign, one below zero is beyond any end.
        piece &= col.view(np.uint64) < cols
        piece &= row.view(np.uint64) < rows
        ray, square = piece.nonzero()[0], row[piece] * cols + col[piece]
        cell = self._cell_at[square]
        several = (cell == _BY_HEIGHT).nonzero()[0]
        if len(several):
            of = ray[several]
            start_m = starts_m[0, 2] if len(starts_m) == 1 else starts_m[of, 2]
            cell[several] = self._cells_at(
                square[several], start_m + middle[piece][several] * (ends_m[of, 2] - start_m)
            )
        found = cell >= 0
        return ray[found], cell[found]

    def _cells_at(self, square: np.ndarray, z_m: np.ndarray) -> np.ndarray:
        """Return the cells (n,) of squares, which have some, at heights (n,) m, or `_NONE`."""
        first = self._first[square]
        cell = first + (z_m[:, None] > self._lows_m[first]).sum(axis=1) - 1
        return np.where((cell >= first) & (z_m < self.high_m[cell]), cell, _NONE)

    def in_plan(self, cells: np.ndarray) -> np.ndarray:
        """Return the squares (rows, cols) in which any of some cells, a mask (n,), lies."""
        plan = np.zeros(self.shape, bool)
        plan.reshape(-1)[self.square[cells]] = True
        return plan
