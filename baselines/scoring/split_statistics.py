"""Figures over the mines of a split: interquartile means, stratified intervals, probability of improvement, profiles.

All follow Agarwal et al. 2021 (NeurIPS 34), with one run a mine and the styles of mines as strata.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from baselines.base.statistics import Figure, interquartile_mean
from minexplore.splits import STYLES

INTERVAL = (2.5, 97.5)  # percentiles
_RESAMPLES = 2000


def stratified(statistic: Callable[..., float], *values: np.ndarray, strata: np.ndarray, seed: int = 0) -> Figure:
    """Return a statistic of values with its percentile bootstrap interval; mines are drawn again within their stratum.

    Parameters
    ----------
    statistic : callable
        Of one array (n,) for each of `values`.
    *values : (n,) float
        Of the same mines: they are drawn together.
    strata : (n,) int
    seed : int
    """
    drawn = [statistic(*(v[rows] for v in values)) for rows in draws(strata, seed)]
    low, high = np.percentile(drawn, INTERVAL)
    return Figure(float(statistic(*values)), float(low), float(high), len(strata))


def strata_of(mines: int) -> np.ndarray:
    """Return the stratum (mines,) of each mine of a split: its style, which alternate over the mines."""
    return np.arange(mines) % len(STYLES)


def draws(strata: np.ndarray, seed: int = 0) -> Iterator[np.ndarray]:
    """Yield indices (n,) of mines of strata (n,), drawn again within each stratum: the samples of a bootstrap."""
    rng = np.random.default_rng(seed)
    members = [np.flatnonzero(strata == stratum) for stratum in np.unique(strata)]
    for _ in range(_RESAMPLES):
        yield np.concatenate([rng.choice(m, len(m)) for m in members])


def middle(values: np.ndarray) -> float:
    """Return the interquartile mean of values (n,)."""
    return float(interquartile_mean(values))


def improvement(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Return the probability that ours is better than theirs in a mine drawn at random; equal counts half.

    With one run a mine this is the mean over mines of the Mann-Whitney statistic U / (1 * 1).
    """
    return float(np.mean((ours > theirs) + 0.5 * (ours == theirs)))


def difference(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Return the difference of the interquartile means of values (n,) of the same mines."""
    return middle(ours) - middle(theirs)


def profile(values: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """Return the share (k,) of values (n,) that are above each level (k,): a performance profile."""
    return (values[:, None] > levels).mean(axis=0)
