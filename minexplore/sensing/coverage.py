"""Which cells of the workings a robot can reach, and which its beams have seen."""

from __future__ import annotations

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
        """Return ray numbers of segments (n, 3) to (n, 3) m, and the indices in `reachable` of cells they cross."""

    def mark(self, seen: np.ndarray, observer: np.ndarray, *cell: np.ndarray) -> np.ndarray:
        """Mark cells as seen by their observers; return how many are new to each."""

    def forget(self, seen: np.ndarray, low_m: np.ndarray, high_m: np.ndarray) -> None:
        """Clear what one observer has seen in a box, seen from above."""

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
        standing = _connected(world, world.clearance_m >= radius_m, centre_m)
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
        """Return ray numbers, rows and columns of all cells that segments (n, 3) to (n, 3) pass through.

        Exact: each segment, no longer than `longest_m`, is cut at every grid line it crosses, and each piece names the
        cell of its middle.
        """
        ray, row, col, _ = cut_at_lines(self.origin_m, self.cell_m, starts_m[:, :2], ends_m[:, :2], longest_m)
        rows, cols = self.reachable.shape
        # Seen as a number without sign, one below zero is beyond any end.
        inside = (col.view(np.uint64) < cols) & (row.view(np.uint64) < rows)
        return (ray, row, col) if inside.all() else (ray[inside], row[inside], col[inside])

    def mark(self, seen: np.ndarray, observer: np.ndarray, *cell: np.ndarray) -> np.ndarray:
        """Mark cells, rows and columns, as seen in `seen` (m, rows, cols) by their observers.

        Return how many are new to each (m,).
        """
        row, col = cell
        number = row * self.reachable.shape[1] + col
        flat = observer * self.reachable.size + number
        view = seen.reshape(-1)
        unseen = flat[self.reachable.reshape(-1)[number] > view[flat]]
        if not len(unseen):
            return np.zeros(len(seen), np.int64)
        unseen.sort()
        new = unseen[np.append(True, unseen[1:] != unseen[:-1])]
        view[new] = True
        return np.bincount(new // self.reachable.size, minlength=len(seen))

    def forget(self, seen: np.ndarray, low_m: np.ndarray, high_m: np.ndarray) -> None:
        """Clear the cells of one observer (rows, cols) that meet a box of the plan (2,) to (2,) m."""
        low, high = np.floor((np.stack([low_m, high_m]) - self.origin_m) / self.cell_m).astype(int)
        (west, south), (east, north) = np.maximum(low, 0), np.maximum(high + 1, 0)
        seen[south:north, west:east] = False

    def in_plan(self, cells: np.ndarray) -> np.ndarray:
        """Return a mask of cells as one of the plan's squares (rows, cols): here they are the same."""
        return cells


def cut_at_lines(
    origin_m: np.ndarray, cell_m: float, starts_m: np.ndarray, ends_m: np.ndarray, longest_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return ray numbers, rows, columns and middles, as shares of segments, of the pieces between a grid's lines.

    Segments (n, 2) to (n, 2) m are at most `longest_m` long.
    """
    start = ((starts_m - origin_m) / cell_m)[..., None]
    step = ((ends_m - origin_m) / cell_m)[..., None] - start
    lines = np.arange(1.0, int(np.ceil(longest_m / cell_m)) + 2)
    along = np.where(step > 0, start, -start)  # on either axis, in the direction of the segment
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (np.floor(along) + lines - along) / np.abs(step)  # (n, 2, lines)
    at = np.ones((len(start), 2 * len(lines) + 2))  # where pieces end; those beyond the end have no length
    at[:, 0] = 0.0
    at[:, 1:-1] = np.fmin(share, 1.0).reshape(len(start), -1)
    at.sort(axis=1)
    middle = (at[:, 1:] + at[:, :-1]) / 2
    cell = np.floor(start + middle[:, None] * step).astype(np.int64)
    piece = at[:, 1:] > at[:, :-1]
    return piece.nonzero()[0], cell[:, 1][piece], cell[:, 0][piece], middle[piece]


def _connected(world: World, standing: np.ndarray, centre_m: np.ndarray) -> np.ndarray:
    """Return the cells of a mask that are connected to the one nearest to a place."""
    row, col = np.nonzero(standing)
    if not len(row):
        raise ValueError(f"{world.folder}: no place where the robot fits")
    places = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
    seed = int(np.linalg.norm(places - centre_m, axis=1).argmin())
    unseen = np.pad(standing, 1)  # a border of rock: no step leaves the grid
    width = unseen.shape[1]
    first = (row[seed] + 1) * width + col[seed] + 1
    edge, left = np.array([first]), unseen.reshape(-1)
    left[edge] = False
    while len(edge):  # all cells that are one step farther at a time, side by side, so that none comes twice
        sides = []
        for step in (1, -1, width, -width):
            beside = edge + step
            beside = beside[left[beside]]
            left[beside] = False
            sides.append(beside)
        edge = np.concatenate(sides)
    return standing & ~unseen[1:-1, 1:-1]
