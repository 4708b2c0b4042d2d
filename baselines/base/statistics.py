"""Figures of a policy's episodes: interquartile means with bootstrap intervals over seeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from baselines.base.errors import BaselineError
from baselines.base.result_file import SAMPLE_STEPS, Episode, Head

_TIMES_S, _SHARES = (60, 300, 600), (0.5, 0.75, 0.9)
_RESAMPLES, _CONFIDENCE = 2000, 0.95
_CURVE_POINTS = 601


@dataclass(frozen=True)
class Figure:
    """An interquartile mean and its 95 % interval; None where no episode has the figure."""

    value: float | None
    low: float | None
    high: float | None
    count: int


def interquartile_mean(values: np.ndarray, axis: int = 0) -> np.ndarray:
    """Return the mean of the middle half of finite values (Agarwal et al. 2021, NeurIPS 34).

    It is SciPy's `trim_mean(values, 0.25, axis)` without its checks, which take most of the time of an interval.
    """
    count = values.shape[axis]
    cut = int(0.25 * count)
    parted = np.partition(values, (cut, count - cut - 1), axis)
    return np.mean(parted.take(range(cut, count - cut), axis), axis=axis)


def estimate(values: list[float], seed: int = 0) -> Figure:
    """Return the interquartile mean of values with its percentile bootstrap interval."""
    if not values:
        return Figure(None, None, None, 0)
    found = np.array(values, dtype=float)
    middle = float(interquartile_mean(found))
    if len(found) < 2 or np.ptp(found) == 0:
        return Figure(middle, middle, middle, len(found))
    from scipy.stats import bootstrap  # takes half a second to load, and most commands need no interval

    interval = bootstrap(
        (found,),
        interquartile_mean,
        n_resamples=_RESAMPLES,
        confidence_level=_CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(seed),
    ).confidence_interval
    return Figure(middle, float(interval.low), float(interval.high), len(found))


def figures(head: Head, episodes: list[Episode], bound: Callable[[float], int] | None) -> Mapping[str, Figure]:
    """Return all figures of a policy in an environment.

    Parameters
    ----------
    head, episodes
        A results file's.
    bound : callable, optional
        Returns the most cells that any robot can have seen after so many seconds.
    """
    found: dict[str, list[float]] = {}
    for episode in episodes:
        for name, value in (_coverage_of(head, episode, bound) | _motion_of(episode)).items():
            found.setdefault(name, []).append(value)
    return {name: estimate(values) for name, values in found.items()}


def _coverage_of(head: Head, episode: Episode, bound: Callable[[float], int] | None) -> dict[str, float]:
    """Return the figures of an episode's coverage curve; an episode that ended early keeps what it had seen."""
    control = _number(head, "control_s")
    horizon = _number(head, "max_steps") * control
    times, share = sample_times(episode, control), np.array(episode.seen) / head.cells
    found: dict[str, float] = {}
    for at in (*(t for t in _TIMES_S if t < horizon), horizon):
        now = float(np.interp(at, times, share))
        found[f"coverage at {at:g} s"] = now
        if bound is not None:
            found[f"share of bound at {at:g} s"] = now * head.cells / bound(at)
    curve = np.interp(np.linspace(0, horizon, _CURVE_POINTS), times, share)
    found["area under coverage"] = float(np.trapezoid(curve) / (_CURVE_POINTS - 1))
    for part in _SHARES:
        if share[-1] >= part:
            found[f"time to {100 * part:g} %, s"] = float(times[int((share >= part).argmax())])
    return found


def _number(head: Head, name: str) -> float:
    value = head.task.get(name)
    if not isinstance(value, int | float):
        raise BaselineError(f"results of {head.policy}: task has {name} = {value!r}: want a number")
    return value


def _motion_of(episode: Episode) -> dict[str, float]:
    """Return the figures of an episode's path, collisions and return."""
    new, moved = episode.seen[-1] - episode.seen[0], episode.path_m > 1
    per_100_m = 100 / episode.path_m if moved else 0.0
    return {
        "new cells per 100 m": new * per_100_m,
        "collisions per 100 m": episode.collided * per_100_m if moved else float(episode.collided),
        "return": episode.returned,
        "path, m": episode.path_m,
    }


def sample_count(steps: int) -> int:
    """Return the number of samples of an episode: at its start, every `SAMPLE_STEPS`, and at its end."""
    return (steps - 1) // SAMPLE_STEPS + 2


def sample_times(episode: Episode, control_s: float) -> np.ndarray:
    """Return the times, s, of an episode's samples."""
    return np.array([*range(0, episode.steps, SAMPLE_STEPS), episode.steps]) * control_s


def as_text(name: str, figure: Figure) -> str:
    """Return a figure with its interval as tables print it."""
    if figure.value is None or figure.low is None or figure.high is None:
        return "never"
    percent = name.startswith(("coverage at", "share", "area"))
    scale, unit = (100, " %") if percent else (1, "")
    return f"{scale * figure.value:.1f}{unit} ({scale * figure.low:.1f}-{scale * figure.high:.1f})"
