"""What a team of any size can have seen at best: the cells in view from all places that its robots can have reached."""

from __future__ import annotations

import numpy as np

from baselines.oracle import span_views, visibility
from baselines.oracle.network import arrival_times
from baselines.oracle.problem import CoverageProblem
from baselines.oracle.spans import arrival_over_spans


def cells_within_reach(problem: CoverageProblem, starts_m: np.ndarray, band_s: float) -> np.ndarray:
    """Return the most cells (k,) that a team can have seen before the times band_s, 2 band_s, ..., k band_s.

    It counts the cells in view from anywhere that a robot can come to in that time, as if there were a robot at each
    place. So it limits teams of every size.

    Parameters
    ----------
    problem : CoverageProblem
    starts_m : (n, 3)
        Where the robots start, mine frame; in a level mine the height does not count.
    band_s : float
    """
    if problem.world.volume is None:
        arrival_s = arrival_times(problem, starts_m[:, :2])[1]
        band = _bands(arrival_s, band_s)
        in_view = visibility.cells_in_view(problem, band)
    else:
        links, _, arrival_s = arrival_over_spans(problem, starts_m)
        band = _bands(arrival_s, band_s)
        in_view = span_views.cells_in_view(problem, np.flatnonzero(links.standing), band)
    first = np.full(problem.grid.reachable.size, band.max() + 1)
    for number, cells in enumerate(in_view):
        first[cells] = np.minimum(first[cells], number)
    counts = np.bincount(first, minlength=band.max() + 2)
    return counts[1:-1].cumsum()


def _bands(arrival_s: np.ndarray, band_s: float) -> np.ndarray:
    """Return the number of the band, from 1, of each time; 0 where it is infinite."""
    reached = np.isfinite(arrival_s)
    return np.where(reached, np.where(reached, arrival_s, 0.0) // band_s + 1, 0).astype(int)


def least_time_s(within_reach: np.ndarray, band_s: float, cells: int) -> float:
    """Return a time, s, before which no team can have seen so many cells; see `cells_within_reach`."""
    return float(band_s * int(np.searchsorted(within_reach, cells)))
