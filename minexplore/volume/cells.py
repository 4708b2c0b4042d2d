"""The cells of a volume that a robot can reach, and which its beams have seen."""

from __future__ import annotations

import numpy as np

from minexplore.floors.volume_arrays import FloorSpans
from minexplore.sensing.coverage import cut_at_lines

_APART_M = 1.0  # floors of one square that are so far apart in height are two cells: no robot fits between them
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
        self._most = int(np.diff(self._first).max())

    def cells_crossed(
        self, starts_m: np.ndarray, ends_m: np.ndarray, longest_m: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return ray numbers and cells that segments (n, 3), or (1, 3), to (n, 3) m pass through.

        Each segment, no longer than `longest_m`, is cut at every grid line it crosses, and each piece names the cell
        whose floor is the next under its middle, if the middle is under that cell's roof.
        """
        piece, at, middle = cut_at_lines(self.origin_m, self.cell_m, starts_m[:, :2], ends_m[:, :2], longest_m)
        rows, cols = self.shape
        col, row = at[:, 0], at[:, 1]
        inside = piece & (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
        ray, share, square = inside.nonzero()[0], middle[inside], row[inside] * cols + col[inside]
        start_m = np.broadcast_to(starts_m, ends_m.shape)[ray, 2]
        z = start_m + share * (ends_m[ray, 2] - start_m)
        start, end = self._first[square], self._first[square + 1]
        cell = np.full(len(ray), -1)
        for k in range(self._most):
            at = np.flatnonzero(start + k < end)
            number = start[at] + k
            over = z[at] > self.low_m[number]
            cell[at[over]] = number[over]
        found = np.flatnonzero((cell >= 0) & (z < self.high_m[cell]))
        return ray[found], cell[found]

    def mark(self, seen: np.ndarray, observer: np.ndarray, *cell: np.ndarray) -> np.ndarray:
        """Mark cells as seen in `seen` (m, cells) by their observers; return how many are new to each (m,)."""
        (number,) = cell
        flat = observer * self.total + number
        view = seen.reshape(-1)
        new = np.unique(flat[~view[flat]])
        view[new] = True
        return np.bincount(new // self.total, minlength=len(seen))

    def in_plan(self, cells: np.ndarray) -> np.ndarray:
        """Return the squares (rows, cols) in which any of some cells, a mask (n,), lies."""
        plan = np.zeros(self.shape, bool)
        plan.reshape(-1)[self.square[cells]] = True
        return plan
