"""What is told of a policy's episodes: interquartile means with bootstrap intervals over seeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import bootstrap, trim_mean

from baselines.protocol import SAMPLE_STEPS, Episode, Head

_TIMES_S, _SHARES = (60, 300, 600), (0.5, 0.75, 0.9)
_RESAMPLES, _CONFIDENCE = 2000, 0.95


@dataclass(frozen=True)
class Figure:
    """An interquartile mean and its 95 % interval; None where no episode has the figure."""

    value: float | None
    low: float | None
    high: float | None
    count: int


def interquartile_mean(values: np.ndarray, axis: int = 0) -> np.ndarray:
    """Return the mean of the middle half of values (Agarwal et al. 2021, NeurIPS 34)."""
    return trim_mean(values, 0.25, axis=axis)


def estimate(values: list[float], seed: int = 0) -> Figure:
    """Return the interquartile mean of values with its percentile bootstrap interval."""
    if not values:
        return Figure(None, None, None, 0)
    found = np.array(values, dtype=float)
    middle = float(interquartile_mean(found))
    if len(found) < 2 or np.ptp(found) == 0:
        return Figure(middle, middle, middle, len(found))
    interval = bootstrap(
        (found,), interquartile_mean, n_resamples=_RESAMPLES, confidence_level=_CONFIDENCE, method="percentile",
        rng=np.random.default_rng(seed),
    ).confidence_interval  # fmt: skip
    return Figure(middle, float(interval.low), float(interval.high), len(found))


def figures(head: Head, episodes: list[Episode], bound: Callable[[float], int] | None) -> Mapping[str, Figure]:
    """Return all figures of a policy in an environment.

    Parameters
    ----------
    head, episodes
        A results file's.
    bound : callable, optional
        Gives the most cells that any robot can have seen after so many seconds.
    """
    control = float(head.task["control_s"])
    horizon = int(head.task["max_steps"]) * control
    found: dict[str, list[float]] = {}

    def add(name: str, value: float) -> None:
        found.setdefault(name, []).append(value)

    for episode in episodes:
        times, share = sample_times(episode, control), np.array(episode.seen) / head.cells
        for at in (t for t in _TIMES_S if t <= horizon):
            now = float(np.interp(at, times, share))  # an episode that ended keeps what it had seen
            add(f"coverage at {at} s", now)
            if bound is not None:
                add(f"share of bound at {at} s", now * head.cells / bound(at))
        if horizon not in _TIMES_S:
            add(f"coverage at {horizon:g} s", float(share[-1]))
            if bound is not None:
                add(f"share of bound at {horizon:g} s", episode.seen[-1] / bound(horizon))
        curve = np.interp(np.linspace(0, horizon, 601), times, share)
        add("area under coverage", float(np.trapezoid(curve) / 600))
        for part in _SHARES:
            if share[-1] >= part:
                add(f"time to {100 * part:g} %, s", float(times[int((share >= part).argmax())]))
        length = max(episode.path_m, 1e-9)
        new = episode.seen[-1] - episode.seen[0]
        add("new cells per 100 m", 100 * new / length if episode.path_m > 1 else 0.0)
        add("collisions per 100 m", 100 * episode.collided / length if episode.path_m > 1 else float(episode.collided))
        add("return", episode.returned)
        add("path, m", episode.path_m)
    return {name: estimate(values) for name, values in found.items()}


def sample_times(episode: Episode, control_s: float) -> np.ndarray:
    """Return the times, s, of an episode's samples."""
    return np.array([*range(0, episode.steps, SAMPLE_STEPS), episode.steps]) * control_s
