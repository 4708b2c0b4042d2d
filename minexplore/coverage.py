"""Which cells of the workings a robot can reach, and which its beams have seen."""

from __future__ import annotations

import numpy as np

from minexplore.world import World


class CoverageGrid:
    """Square cells over the mine frame; `reachable[i, j]` covers origin + (j, i) * cell to + (j + 1, i + 1) * cell."""

    def __init__(self, world: World, cell_m: float, radius_m: float, centre_m: np.ndarray, reach_m: float) -> None:
        """Find the cells that a disc of `radius_m` can stand in, connected to `centre_m` and within `reach_m` of it."""
        standing = _connected(world, world.clearance_m >= radius_m, centre_m)
        row, col = np.nonzero(standing)
        places = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
        places = places[np.linalg.norm(places - centre_m, axis=1) <= reach_m]
        self.cell_m = cell_m
        self.origin_m = np.floor(world.origin_m / cell_m) * cell_m
        cols, rows = np.ceil((world.record["world_m"][2:] - self.origin_m) / cell_m).astype(int)
        self.reachable = np.zeros((rows, cols), dtype=bool)
        at = np.floor((places - self.origin_m) / cell_m).astype(int)
        self.reachable[at[:, 1], at[:, 0]] = True
        self.total = int(self.reachable.sum())

    def cells_crossed(self, start_m: np.ndarray, ends_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return rows and columns of all cells that the segments from one start to (n, 2) ends pass through.

        Exact: each segment is cut at every grid line it crosses, and each piece names the cell of its middle.
        """
        start, ends = (start_m - self.origin_m) / self.cell_m, (ends_m - self.origin_m) / self.cell_m
        step = ends - start
        cuts = [np.zeros((len(ends), 1)), np.ones((len(ends), 1))]
        for axis in (0, 1):
            low = int(np.floor(min(start[axis], ends[:, axis].min())))
            high = int(np.ceil(max(start[axis], ends[:, axis].max())))
            lines = np.arange(low, high + 1)
            with np.errstate(divide="ignore", invalid="ignore"):
                share = (lines - start[axis]) / step[:, axis : axis + 1]
            cuts.append(np.where((share > 0) & (share < 1), share, 1.0))
        at = np.sort(np.hstack(cuts), axis=1)
        middle = (at[:, 1:] + at[:, :-1]) / 2
        cells = np.floor(start + middle[..., None] * step[:, None]).astype(int)[at[:, 1:] > at[:, :-1]]
        rows, cols = self.reachable.shape
        inside = (cells[:, 0] >= 0) & (cells[:, 0] < cols) & (cells[:, 1] >= 0) & (cells[:, 1] < rows)
        return cells[inside, 1], cells[inside, 0]


def _connected(world: World, standing: np.ndarray, centre_m: np.ndarray) -> np.ndarray:
    """Return the part of a mask that hangs together with the cell nearest to a place."""
    row, col = np.nonzero(standing)
    if not len(row):
        raise ValueError(f"{world.folder}: no place where the robot fits")
    places = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
    seed = int(np.linalg.norm(places - centre_m, axis=1).argmin())
    found = np.zeros_like(standing)
    front = np.zeros_like(standing)
    front[row[seed], col[seed]] = True
    while front.any():
        found |= front
        grown = np.zeros_like(front)
        grown[1:] |= front[:-1]
        grown[:-1] |= front[1:]
        grown[:, 1:] |= front[:, :-1]
        grown[:, :-1] |= front[:, 1:]
        front = grown & standing & ~found
    return found
