"""The coverage cells in view from floor spans of a volume: beams cast all round, between floors and roofs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from baselines.oracle.problem import CoverageProblem
from baselines.oracle.visibility import _MARCH_M, _RAYS, _SAMPLE_M, SURFACE_M
from minexplore.volume.cells import VolumeGrid
from minexplore.volume.standing import ColumnFloors

_LEAN = 0.06  # rise per metre that a robot leans by more than its floor: 3.3 deg on its castors in 95 % of steps
_STEEPEST = 0.364  # rise over run of floors that robots stand on
_LAST_M = 1.0  # of height beyond a floor or roof: they change within a column, and visible rock stands back


@dataclass(frozen=True)
class FreeHeights:
    """Free space by columns, widened by the visible rock: in column (row, col), heights from `low_m` to `high_m`.

    Both are (k, rows, cols) m, nan where a column has fewer; the first column is `first` (row, col) of the spans' grid.
    """

    low_m: np.ndarray
    high_m: np.ndarray
    first: np.ndarray


def free_heights(spans: ColumnFloors) -> FreeHeights:
    """Return the free space over all floors and 0.5 m beside them; heights that meet are one."""
    reach = round(SURFACE_M / spans.cell_m)
    beside = [
        (i, j) for i in range(-reach, reach + 1) for j in range(-reach, reach + 1) if i * i + j * j <= reach * reach
    ]
    first = np.array([spans.row.min() - reach, spans.column.min() - reach])
    rows, cols = (np.array([spans.row.max(), spans.column.max()]) + reach + 1 - first).tolist()
    at = np.concatenate([(spans.row - first[0] + i) * cols + spans.column - first[1] + j for i, j in beside])
    low = np.tile(spans.floor_m - _LAST_M, len(beside))
    high = np.tile(spans.floor_m + spans.headroom_m + _LAST_M, len(beside))
    order = np.lexsort([low, at])
    at, low, high = at[order], low[order], high[order]
    lifted = high + at * 1e6  # columns are apart, so that the highest so far is that of the column
    top = np.maximum.accumulate(lifted)
    new = np.append(True, (np.diff(at) != 0) | (low[1:] + at[1:] * 1e6 > top[:-1]))
    begin = np.flatnonzero(new)
    column, lowest = at[begin], low[begin]
    highest = top[np.append(begin[1:] - 1, len(at) - 1)] - column * 1e6
    order_in = np.arange(len(begin)) - np.searchsorted(column, column)
    shape = (int(order_in.max()) + 1, rows * cols)
    found = np.full((2, *shape), np.nan)
    found[0, order_in, column], found[1, order_in, column] = lowest, highest
    free_low, free_high = found.reshape(2, shape[0], rows, cols)
    return FreeHeights(free_low, free_high, first)


def cells_in_view(problem: CoverageProblem, numbers: np.ndarray, regions: np.ndarray) -> list[np.ndarray]:
    """Return the coverage cells that beams from anywhere in each region may cross.

    A robot's beams rise or fall by the steepest floor and its lean at most.

    Parameters
    ----------
    problem : CoverageProblem
    numbers : (n,) int
        Of spans.
    regions : (n,) int
        Numbers of regions from 1; 0 where no robot comes.

    Returns
    -------
    list of (k,) int
        Cells by region; the first entry, of no region, is empty.
    """
    assert problem.world.volume is not None
    spans, grid = problem.world.volume.spans, problem.grid
    assert isinstance(grid, VolumeGrid)
    free, rise = free_heights(spans), _STEEPEST + _LEAN
    far = problem.task.range_m[1] + _SAMPLE_M / np.sqrt(2)
    angle = np.linspace(0, 2 * np.pi, _RAYS, endpoint=False)
    steps = np.arange(0.0, far + _MARCH_M, _MARCH_M)
    offsets = np.stack([np.cos(angle), np.sin(angle)], axis=-1)[:, None, :] * steps[:, None]  # (rays, steps, 2)
    seen: list[set[int]] = [set() for _ in range(int(regions.max()) + 1)]
    for number in samples_of(spans, numbers, regions, max(1, round(_SAMPLE_M / spans.cell_m))):
        place = spans.places_m[numbers[number]]
        eye = place[2] + problem.robot.sensor_height_m
        points, low, high = place[:2] + offsets, eye - rise * steps, eye + rise * steps
        at = np.floor((points - spans.origin_m) / spans.cell_m).astype(int)[..., ::-1] - free.first
        inside = ((at >= 0) & (at < free.low_m.shape[1:])).all(axis=-1)
        at[~inside] = 0
        with np.errstate(invalid="ignore"):
            meets = (free.low_m[:, at[..., 0], at[..., 1]] <= high) & (free.high_m[:, at[..., 0], at[..., 1]] >= low)
        clear = np.logical_and.accumulate(meets.any(axis=0) & inside, axis=1)
        ray, step = np.nonzero(clear)
        seen[regions[number]].update(_cells_at(grid, points[ray, step], low[step], high[step]).tolist())
    return [np.array(sorted(found), dtype=int) for found in seen]


def _cells_at(grid: VolumeGrid, places_m: np.ndarray, low_m: np.ndarray, high_m: np.ndarray) -> np.ndarray:
    """Return the cells in the squares of places (n, 2) m that are in some heights (n,) m, by up to a metre."""
    cell = np.floor((places_m - grid.origin_m) / grid.cell_m).astype(int)
    within = ((cell >= 0) & (cell < grid.shape[::-1])).all(axis=1)
    square = cell[within, 1] * grid.shape[1] + cell[within, 0]
    squares, which = np.unique(square, return_inverse=True)
    lowest, highest = np.full(len(squares), np.inf), np.full(len(squares), -np.inf)
    np.minimum.at(lowest, which.reshape(-1), low_m[within] - _LAST_M)
    np.maximum.at(highest, which.reshape(-1), high_m[within] + _LAST_M)
    start, end = (np.searchsorted(grid.square, squares, side=side) for side in ("left", "right"))
    number = np.repeat(start - np.cumsum(end - start) + (end - start), end - start) + np.arange((end - start).sum())
    of = np.repeat(np.arange(len(squares)), end - start)
    meets = (grid.low_m[number] <= highest[of]) & (grid.high_m[number] >= lowest[of])
    return np.asarray(number[meets])


def samples_of(spans: ColumnFloors, numbers: np.ndarray, regions: np.ndarray, every: int) -> list[int]:
    """Return every n-th span in either direction of the regions, and one of each region that these miss."""
    on = (spans.row[numbers] % every == 0) & (spans.column[numbers] % every == 0)
    picked = np.flatnonzero((regions > 0) & on)
    missed = np.setdiff1d(np.arange(1, int(regions.max()) + 1), regions[picked])
    _, first = np.unique(regions, return_index=True)
    of = dict(zip(np.unique(regions).tolist(), first.tolist(), strict=True))
    return [*picked.tolist(), *(of[region] for region in missed.tolist())]
