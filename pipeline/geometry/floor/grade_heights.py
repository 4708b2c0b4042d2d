"""Heights of the stations of a network from the grades between them, by least squares."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.geometry.floor.solved_heights import solve_heights


def heights_of_grades(pairs: np.ndarray, run_m: np.ndarray, grade: np.ndarray) -> np.ndarray:
    """Return the height of each station, counted from the first.

    The sum of squared differences from the stated rises, each over its length, is least: a loop that does not close
    changes the grades round it by equal parts. Shots without a grade are as flat as those leave them: linear between
    stations that grades join, level elsewhere.

    Parameters
    ----------
    pairs : (m, 2) int
        The stations from and to of each shot, which join all of them.
    run_m : (m,) m
        Length in plan.
    grade : (m,)
        Rise over run; nan where it is not known.

    Returns
    -------
    (n,) m
        Of the stations from 0 to the largest of `pairs`.
    """
    count, known = int(pairs.max()) + 1, np.isfinite(grade)
    joined = coo_matrix((np.ones(known.sum()), pairs[known].T), (count, count))
    pieces, piece = connected_components(joined, directed=False)
    first = np.unique(piece, return_index=True)[1]
    z = _least_squares(count, pairs[known], run_m[known], (grade * run_m)[known], first)
    rise = (z[pairs[:, 0]] - z[pairs[:, 1]])[~known]  # of the pieces, for a level shot
    between = piece[pairs[~known]]
    z += _least_squares(pieces, between, run_m[~known], rise, piece[:1])[piece]
    return z


def misclosure_at(shot: int, pairs: np.ndarray, run_m: np.ndarray, grade: np.ndarray) -> float:
    """Return by how much, m, the rise of a shot of a loop differs from what all others give it."""
    others = grade.copy()
    others[shot] = np.nan
    z = heights_of_grades(pairs, run_m, others)
    a, b = pairs[shot]
    return float(grade[shot] * run_m[shot] - (z[b] - z[a]))


def _least_squares(
    count: int, pairs: np.ndarray, run_m: np.ndarray, rise_m: np.ndarray, pinned: np.ndarray
) -> np.ndarray:
    """Return heights (count,) m with those of `pinned` at 0, one in each connected piece."""
    rows = np.arange(len(pairs))
    ends = np.concatenate([np.ones(len(pairs)), -np.ones(len(pairs))])
    steps = coo_matrix((ends, (np.tile(rows, 2), pairs[:, ::-1].T.ravel())), (len(pairs), count)).tocsc()
    free = np.setdiff1d(np.arange(count), pinned)
    z = np.zeros(count)
    if len(free):
        weighted = steps[:, free].T.multiply(1.0 / run_m).tocsc()
        z[free] = solve_heights((weighted @ steps[:, free]).tocsc(), weighted @ rise_m)
    return z
