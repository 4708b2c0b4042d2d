"""A robot's own map: where its beams passed, where they ended at rock, and which coverage cells that makes seen."""

from __future__ import annotations

import numpy as np

FINE = 5  # fine cells along a coverage cell: 0.4 m of 2 m
UNKNOWN, FREE, ROCK = 0, 1, 2
_GROW = 64  # coverage cells added when a map becomes too small


class OwnMap:
    """Grows as it is needed; `fine[i, j]` covers origin + (j, i) * cell_m / FINE, `seen` the coverage cells.

    The coverage cells are those of the task, whose lines lie at multiples of their size in the mine frame.
    """

    def __init__(self, cell_m: float) -> None:
        """Start with nothing known."""
        self.cell_m, self.fine_m = cell_m, cell_m / FINE
        self.low = np.zeros(2, dtype=int)  # coverage cell (col, row) of the map's south-west corner
        self.seen = np.zeros((0, 0), dtype=bool)
        self.fine = np.zeros((0, 0), dtype=np.uint8)

    def add(self, place: np.ndarray, bearings: np.ndarray, ranges: np.ndarray, far_m: float) -> None:
        """Take in beams from a place (2,) m at bearings (k,) rad; a range (k,) of `far_m` hit nothing."""
        along = np.column_stack([np.cos(bearings), np.sin(bearings)])
        ends = place + along * ranges[:, None]
        self._hold(np.vstack([ends, place]))
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

    def _hold(self, places: np.ndarray) -> None:
        """Grow so that places lie inside, with room for what is next to them."""
        cells = np.floor(places / self.cell_m).astype(int)
        least, most = cells.min(axis=0) - 2, cells.max(axis=0) + 3
        high = self.low + self.seen.shape[::-1]
        if self.seen.size and (least >= self.low).all() and (most <= high).all():
            return
        if not self.seen.size:
            self.low = high = cells[-1]
        low = np.where(least < self.low, least - _GROW, self.low)
        high = np.where(most > high, most + _GROW, high)
        for name, factor in (("seen", 1), ("fine", FINE)):
            old = getattr(self, name)
            new = np.zeros(((high - low) * factor)[::-1], dtype=old.dtype)
            col, row = (self.low - low) * factor
            new[row : row + old.shape[0], col : col + old.shape[1]] = old
            setattr(self, name, new)
        self.low = low

    def frontier(self) -> np.ndarray:
        """Return unseen coverage cells (rows, cols) bool beside seen ones, with no rock known on the border."""
        rows, cols = self.seen.shape
        found = np.zeros_like(self.seen)
        blocks = self.fine.reshape(rows, FINE, cols, FINE)
        west, east, south, north = blocks[:, :, :, 0], blocks[:, :, :, -1], blocks[:, 0], blocks[:, -1]
        for ours, theirs, seen, there in (
            (east[:, :, :-1], west[:, :, 1:], self.seen[:, :-1], (slice(None), slice(1, None))),
            (west[:, :, 1:], east[:, :, :-1], self.seen[:, 1:], (slice(None), slice(None, -1))),
        ):
            open_ = ((ours != ROCK) & (theirs == UNKNOWN)).any(axis=1)
            found[there] |= open_ & seen
        for ours, theirs, seen, there in (
            (north[:-1], south[1:], self.seen[:-1], (slice(1, None), slice(None))),
            (south[1:], north[:-1], self.seen[1:], (slice(None, -1), slice(None))),
        ):
            open_ = ((ours != ROCK) & (theirs == UNKNOWN)).any(axis=-1)
            found[there] |= open_ & seen
        return found & ~self.seen
