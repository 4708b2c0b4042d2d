"""Parts of a mask as runs of cells, so that their number costs memory and not the mask's area."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pipeline.types import Mask

_ROWS = 1024  # that are searched at once


@dataclass(frozen=True)
class Runs:
    """Runs of true cells, row by row.

    `row`, `start` and `stop` (n,) are a run's row, its first column and the column after its last. `part` (n,) is the
    number of the part that it belongs to. Parts are connected by edges; they are numbered from 0 by their first runs.
    """

    row: np.ndarray
    start: np.ndarray
    stop: np.ndarray
    part: np.ndarray

    @property
    def parts(self) -> int:
        """Return how many parts there are."""
        return int(self.part.max(initial=-1)) + 1

    @property
    def sizes(self) -> np.ndarray:
        """Return the number of cells of each part."""
        return np.bincount(self.part, self.stop - self.start, self.parts).astype(np.int64)

    @property
    def first(self) -> np.ndarray:
        """Return the number of the first run of each part."""
        return np.unique(self.part, return_index=True)[1]


def connected_runs(mask: Mask) -> Runs:
    """Return the runs of the true cells of a mask (rows, cols), and their parts."""
    row, start, stop = runs_of(mask)
    width = mask.shape[1]
    begin, end = row * width + start, row * width + stop
    low = np.searchsorted(end, begin + width, "right")  # of the runs in the next row that a run touches
    count = np.maximum(np.searchsorted(begin, end + width, "left") - low, 0)
    one = np.repeat(np.arange(len(row)), count)
    two = np.arange(len(one)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(low, count)
    touching = coo_array((np.ones(len(one), bool), (one, two)), shape=(len(row), len(row)))
    _, part = connected_components(touching, directed=False)
    _, first, inverse = np.unique(part, return_index=True, return_inverse=True)
    return Runs(row, start, stop, np.argsort(np.argsort(first))[inverse])


def runs_of(mask: Mask) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the runs of the true cells of a mask, row by row: row, first column and column after the last, (n,)."""
    found = []
    for top in range(0, len(mask), _ROWS):
        edge = np.zeros((len(mask[top : top + _ROWS]), mask.shape[1] + 1), bool)
        edge[:, 0], edge[:, -1] = mask[top : top + _ROWS, 0], mask[top : top + _ROWS, -1]
        np.not_equal(mask[top : top + _ROWS, 1:], mask[top : top + _ROWS, :-1], out=edge[:, 1:-1])
        row, col = np.nonzero(edge)
        found.append((row[::2] + top, col[::2], col[1::2]))
    row, start, stop = (np.concatenate(column) for column in zip(*found, strict=True))
    return row, start, stop
