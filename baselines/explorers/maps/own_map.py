"""A robot's own map: free ground, rock, and the coverage cells that its beams have passed through."""

from __future__ import annotations

import numpy as np

FINE = 5  # fine cells along a coverage cell: 0.4 m of 2 m
UNKNOWN, FREE, ROCK = 0, 1, 2
_GROWTH = 64  # coverage cells added when a map becomes too small


class OwnMap:
    """A map that grows as it is needed.

    `fine[i, j]` covers origin + (j, i) * cell_m / FINE, `seen` the coverage cells. The coverage cells are those of the
    task: their borders lie at multiples of the cell size in the mine frame.
    """

    def __init__(self, cell_m: float) -> None:
        """Start with an empty map."""
        self.cell_m, self.fine_m = cell_m, cell_m / FINE
        self.low = np.zeros(2, dtype=int)  # coverage cell (col, row) of the map's south-west corner
        self.seen = np.zeros((0, 0), dtype=bool)
        self.fine = np.zeros((0, 0), dtype=np.uint8)

    def add(self, place: np.ndarray, bearings: np.ndarray, ranges: np.ndarray, far_m: float) -> None:
        """Add beams from a place (2,) m at bearings (k,) rad; a range (k,) of `far_m` is a beam that hit nothing."""
        along = np.column_stack([np.cos(bearings), np.sin(bearings)])
        ends = place + along * ranges[:, None]
        self._grow_to(np.vstack([ends, place]))
        hit = ranges < far_m - 0.05
        steps = np.arange(0.0, far_m, self.fine_m / 2)
        reach = np.minimum(steps, np.maximum(ranges - self.fine_m / 4, 0.0)[:, None])
        row, col = self.at((place + along[:, None, :] * reach[..., None]).reshape(-1, 2), self.fine_m)
        self.seen[row // FINE, col // FINE] = True
        passed = self.fine[row, col]
        self.fine[row, col] = np.where(passed == ROCK, ROCK, FREE)
        row, col = self.at(ends[hit] + along[hit] * (self.fine_m / 4), self.fine_m)
        self.fine[row, col] = ROCK

    def at(self, places: np.ndarray, cell_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Return rows and columns of places (n, 2) m in the fine or the coverage grid."""
        cell = np.floor(places / cell_m + 1e-9).astype(int) - self.low * round(self.cell_m / cell_m)
        return cell[:, 1], cell[:, 0]

    def centres(self, cells: np.ndarray) -> np.ndarray:
        """Return the centres (n, 2) m of fine cells (n, 2), row and column."""
        return (cells[:, ::-1] + 0.5 + self.low * FINE) * self.fine_m

    def _grow_to(self, places: np.ndarray) -> None:
        """Enlarge the map so that places (n, 2) m and their neighbouring cells lie inside."""
        cells = np.floor(places / self.cell_m).astype(int)
        least, most = cells.min(axis=0) - 2, cells.max(axis=0) + 3
        high = self.low + self.seen.shape[::-1]
        if self.seen.size and (least >= self.low).all() and (most <= high).all():
            return
        if not self.seen.size:
            self.low = high = cells[-1]
        low = np.where(least < self.low, least - _GROWTH, self.low)
        high = np.where(most > high, most + _GROWTH, high)
        for name, factor in (("seen", 1), ("fine", FINE)):
            old = getattr(self, name)
            new = np.zeros(((high - low) * factor)[::-1], dtype=old.dtype)
            col, row = (self.low - low) * factor
            new[row : row + old.shape[0], col : col + old.shape[1]] = old
            setattr(self, name, new)
        self.low = low

    def frontier(self) -> np.ndarray:
        """Return unseen coverage cells (rows, cols) bool that border a seen one without known rock between them."""
        found = np.zeros_like(self.seen)
        for found_view, seen, fine in (
            (found, self.seen, self.fine),
            (found[:, ::-1], self.seen[:, ::-1], self.fine[:, ::-1]),
            (found.T, self.seen.T, self.fine.T),
            (found.T[:, ::-1], self.seen.T[:, ::-1], self.fine.T[:, ::-1]),
        ):
            found_view[:, 1:] |= _opens_to_the_next_column(fine) & seen[:, :-1]
        return found & ~self.seen


def _opens_to_the_next_column(fine: np.ndarray) -> np.ndarray:
    """Return whether coverage cells (rows, cols - 1) have a way into unknown ground across their last fine column."""
    rows, cols = (size // FINE for size in fine.shape)
    blocks = fine.reshape(rows, FINE, cols, FINE)
    ours, theirs = blocks[:, :, :-1, -1], blocks[:, :, 1:, 0]
    return ((ours != ROCK) & (theirs == UNKNOWN)).any(axis=1)
