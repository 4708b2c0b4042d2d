"""What a team of any size can have seen at best: the cells in view from all places that its robots can have reached."""

from __future__ import annotations

import numpy as np

from baselines.oracle.network import arrival_times
from baselines.oracle.problem import CoverageProblem
from baselines.oracle.visibility import cells_in_view


def cells_within_reach(problem: CoverageProblem, starts_m: np.ndarray, band_s: float) -> np.ndarray:
    """Return the most cells (k,) that a team can have seen before the times band_s, 2 band_s, ..., k band_s.

    It counts the cells in view from anywhere that a robot can come to in that time, as if there were a robot at each
    place. So it limits teams of every size.

    Parameters
    ----------
    problem : CoverageProblem
    starts_m : (n, 2)
        Where the robots start.
    band_s : float
    """
    standing, arrival_s = arrival_times(problem, starts_m)
    reached = standing & np.isfinite(arrival_s)
    band = np.zeros(standing.shape, dtype=int)
    band[reached] = (arrival_s[reached] // band_s).astype(int) + 1
    first = np.full(problem.grid.reachable.size, band.max() + 1)
    for number, cells in enumerate(cells_in_view(problem, band)):
        first[cells] = np.minimum(first[cells], number)
    counts = np.bincount(first, minlength=band.max() + 2)
    return counts[1:-1].cumsum()


def least_time_s(within_reach: np.ndarray, band_s: float, cells: int) -> float:
    """Return a time, s, before which no team can have seen so many cells; see `cells_within_reach`."""
    return float(band_s * int(np.searchsorted(within_reach, cells)))
