"""Which cells of the workings a robot can reach, and which its beams have seen."""

from __future__ import annotations

import functools
import math
from typing import Protocol

import numpy as np

from minexplore.world import World


class CellGrid(Protocol):
    """Cells that robots can see. `reachable` is a mask of them; a row of what a robot has seen has its shape."""

    cell_m: float
    origin_m: np.ndarray
    reachable: np.ndarray
    total: int

    def cells_crossed(self, starts_m: np.ndarray, ends_m: np.ndarray, longest_m: float) -> tuple[np.ndarray, ...]:
        """Return ray numbers of segments (n, 3) to (n, 3) m, and the indices in `reachable` of cells they cross.

        All may start at one place, (1, 3) m.
        """

    def in_plan(self, cells: np.ndarray) -> np.ndarray:
        """Return the squares (rows, cols), seen from above, in which any of some cells lies."""


class CoverageGrid:
    """Square cells over the mine frame; `reachable[i, j]` covers origin + (j, i) * cell to + (j + 1, i + 1) * cell."""

    def __init__(self, world: World, cell_m: float, radius_m: float, centre_m: np.ndarray, reach_m: float) -> None:
        """Find the cells where a disc of `radius_m` fits, connected to `centre_m` and within `reach_m` of it.

        Raises
        ------
        ValueError
            If the world is one volume, whose floors have no plan, or the disc fits nowhere.
        """
        if world.volume is not None:
            raise ValueError(f"{world.folder}: its mine is one volume; this takes mines whose floors are drawn in plan")
        standing = connected_cells(world, world.clearance_m >= radius_m, centre_m)
        row, col = np.nonzero(standing)
        places = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
        if np.isfinite(reach_m):
            places = places[np.linalg.norm(places - centre_m, axis=1) <= reach_m]
        self.cell_m = cell_m
        self.origin_m = np.floor(world.origin_m / cell_m) * cell_m
        cols, rows = np.ceil((world.record["world_m"][2:] - self.origin_m) / cell_m).astype(int)
        self.reachable = np.zeros((rows, cols), dtype=bool)
        at = np.floor((places - self.origin_m) / cell_m).astype(int)
        self.reachable[at[:, 1], at[:, 0]] = True
        self.total = int(self.reachable.sum())

    def cells_crossed(
        self, starts_m: np.ndarray, ends_m: np.ndarray, longest_m: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return ray numbers, rows and columns of all cells that segments (n, 3), or (1, 3), to (n, 3) m pass through.

        Exact: each segment, no longer than `longest_m`, is cut at every grid line it crosses, and each piece names the
        cell of its middle.
        """
        piece, cell, _ = cut_at_lines(self.origin_m, self.cell_m, starts_m[:, :2], ends_m[:, :2], longest_m)
        rows, cols = self.reachable.shape
        col, row = cell[:, 0], cell[:, 1]
        # Seen as a number without sign, one below zero is beyond any end.
        piece &= col.view(np.uint64) < cols
        piece &= row.view(np.uint64) < rows
        return piece.nonzero()[0], row[piece], col[piece]

    def in_plan(self, cells: np.ndarray) -> np.ndarray:
        """Return a mask of cells as one of the plan's squares (rows, cols): here they are the same."""
        return cells


def mark(grid: CellGrid, seen: np.ndarray, observer: np.ndarray, *cell: np.ndarray) -> np.ndarray:
    """Mark reachable cells, by their indices, as seen in `seen` (m, ...) by their observers.

    Return how many are new to each (m,).
    """
    shape = grid.reachable.shape
    number = cell[0] if len(shape) == 1 else cell[0] * shape[1] + cell[1]
    flat = number if len(seen) == 1 else observer * grid.reachable.size + number
    view = seen.reshape(-1)
    unseen = flat[grid.reachable.reshape(-1)[number] > view[flat]]
    if not len(unseen):
        return np.zeros(len(seen), np.int64)
    unseen.sort()
    new = unseen[np.append(True, unseen[1:] != unseen[:-1])]
    view[new] = True
    return np.bincount(new // grid.reachable.size, minlength=len(seen))


@np.errstate(divide="ignore", invalid="ignore")
def cut_at_lines(
    origin_m: np.ndarray, cell_m: float, starts_m: np.ndarray, ends_m: np.ndarray, longest_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut segments (n, 2), or of one start (1, 2), to (n, 2) m, at most `longest_m` long, at a grid's lines.

    Returns
    -------
    piece : (n, k) bool
        Whether there is a k-th piece of a segment; one has a length.
    cell : (n, 2, k) int64
        Column and row of each piece's middle.
    middle : (n, k) float64
        The middles, as shares of segments.
    """
    start = ((starts_m - origin_m) / cell_m)[..., None]
    step = ((ends_m - origin_m) / cell_m)[..., None] - start
    lines = _numbers_to(math.ceil(longest_m / cell_m) + 1)
    along = np.sign(step) * start  # on either axis, in the direction of the segment
    share = (np.floor(along) + lines - along) / np.abs(step)  # (n, 2, lines)
    at = np.empty((len(step), 2 * len(lines) + 2))  # where pieces end; those beyond the end have no length
    at[:, 0], at[:, -1] = 0.0, 1.0
    np.fmin(share, 1.0, out=at[:, 1:-1].reshape(share.shape))
    at.sort(axis=1)
    before, after = at[:, :-1], at[:, 1:]
    middle = (after + before) / 2
    return after > before, np.floor(start + middle[:, None] * step).astype(np.int64), middle


@functools.cache
def _numbers_to(last: int) -> np.ndarray:
    """Return the numbers (last,) float64 from 1 to `last`; read-only."""
    numbers = np.arange(1.0, last + 1)
    numbers.setflags(write=False)
    return numbers


def connected_cells(world: World, standing: np.ndarray, centre_m: np.ndarray) -> np.ndarray:
    """Return the cells of a mask that are connected to the one nearest to a place."""
    row, col = np.nonzero(standing)
    if not len(row):
        raise ValueError(f"{world.folder}: no place where the robot fits")
    places = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
    seed = int(np.linalg.norm(places - centre_m, axis=1).argmin())
    # Runs of cells that are side by side in a row. Cells are numbered with a gap between rows.
    width = standing.shape[1] + 1
    cell = row * width + col
    first = np.flatnonzero(np.diff(cell, prepend=-2) != 1)
    start, end = cell[first], np.append(cell[first[1:] - 1], cell[-1]) + 1
    # The runs beside each run in the next row.
    low, high = end.searchsorted(start + width, side="right"), start.searchsorted(end + width)
    one = np.arange(len(start)).repeat(high - low)
    other = np.arange(len(one)) + (low - np.append(0, (high - low).cumsum()[:-1])).repeat(high - low)
    group = np.arange(len(start))  # of each run: the number of the first run that it is known to be connected to
    while (group[one] != group[other]).any():
        np.minimum.at(group, np.maximum(group[one], group[other]), np.minimum(group[one], group[other]))
        while (group[group] != group).any():
            group = group[group]
    connected = (group == group[first.searchsorted(seed, side="right") - 1]).repeat(end - start)
    found = np.zeros_like(standing)
    found[row[connected], col[connected]] = True
    return found
