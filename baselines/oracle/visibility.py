"""The coverage cells in view from regions of a mine: beams cast in all directions from a grid of places."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_dilation

from baselines.oracle.problem import CoverageProblem

SURFACE_M = 0.5  # how far behind the collision wall the visible rock may stand back
_SAMPLE_M, _RAYS, _MARCH_M = 0.75, 360, 0.2


def cells_in_view(problem: CoverageProblem, regions: np.ndarray) -> list[np.ndarray]:
    """Return the reachable coverage cells that beams from anywhere in each region may cross.

    Parameters
    ----------
    problem : CoverageProblem
    regions : (rows, cols) int
        Numbers of regions from 1 in the grid of the world's clearance; 0 where no robot can be.

    Returns
    -------
    list of (k,) int
        Flat indices of coverage cells by region; the first entry, of no region, is empty.
    """
    world, grid, count = problem.world, problem.grid, int(regions.max())
    far = problem.task.range_m[1] + _SAMPLE_M / np.sqrt(2)
    open_ = binary_dilation(world.clearance_m > 0, iterations=round(SURFACE_M / world.cell_m))
    angle = np.linspace(0, 2 * np.pi, _RAYS, endpoint=False)
    steps = np.arange(0.0, far + _MARCH_M, _MARCH_M)
    offsets = np.stack([np.sin(angle), np.cos(angle)], axis=-1)[:, None, :] * steps[:, None]  # (rays, steps, 2): y, x
    reachable = grid.reachable.ravel()
    seen: list[set[int]] = [set() for _ in range(count + 1)]
    for row, col in _samples(regions, max(1, round(_SAMPLE_M / world.cell_m))):
        place = world.origin_m[::-1] + (np.array([row, col]) + 0.5) * world.cell_m
        points = place + offsets
        at = np.floor((points - world.origin_m[::-1]) / world.cell_m).astype(int)
        inside = ((at >= 0) & (at < open_.shape)).all(axis=-1)
        at[~inside] = 0
        clear = np.logical_and.accumulate(open_[at[..., 0], at[..., 1]] & inside, axis=1)
        cell = np.floor((points[clear] - grid.origin_m[::-1]) / grid.cell_m).astype(int)
        within = ((cell >= 0) & (cell < grid.reachable.shape)).all(axis=-1)
        flat = np.unique(np.ravel_multi_index(cell[within].T, grid.reachable.shape))
        seen[regions[row, col]].update(flat[reachable[flat]].tolist())
    return [np.array(sorted(cells), dtype=int) for cells in seen]


def _samples(regions: np.ndarray, every: int) -> list[tuple[int, int]]:
    """Return rows and columns of every n-th cell of the regions, and one of each region that these miss."""
    picked = np.zeros_like(regions, dtype=bool)
    picked[::every, ::every] = True
    places = np.argwhere((regions > 0) & picked)
    missed = np.setdiff1d(np.arange(1, int(regions.max()) + 1), regions[tuple(places.T)])
    more = [np.argwhere(regions == region)[0] for region in missed.tolist()]
    return [(int(row), int(col)) for row, col in [*places, *more]]
