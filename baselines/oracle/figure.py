"""The picture of a bound and a tour: the path on the plan, and coverage over time below the bound."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from baselines.base.result_file import Episode
from baselines.base.statistics import sample_times
from baselines.scoring.bounds import Bound
from minexplore.envs.vector import MineVectorEnv

matplotlib.use("Agg")
import matplotlib.pyplot as plt

_INK, _ROCK, _BLUE, _CELL, _TARGET = "#222222", "#d9d4cc", "#1f5a94", "#9ec5e8", "#b04a2f"
_MARGIN_M = 15.0


def draw_oracle(env_id: str, env: MineVectorEnv, bound: Bound, episodes: list[Episode], path: Path) -> None:
    """Write the picture: the first episode's path coloured by time, and all episodes' coverage below the bound."""
    figure, (plan, curve) = plt.subplots(2, 1, figsize=(10, 7), height_ratios=(1.3, 1), layout="constrained")
    dots = _draw_plan(plan, env, episodes[0])
    figure.colorbar(dots, ax=plan, label="time, s", shrink=0.8)
    plan.set(title=f"{env_id}: the oracle's tour", xlabel="easting, m", ylabel="northing, m")
    _draw_coverage(curve, env.task.control_s, bound, episodes)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _draw_plan(plan: Any, env: MineVectorEnv, episode: Episode) -> Any:
    """Draw the mine and an episode's path; return the path's dots."""
    world, task, grid = env.world, env.task, env.robots.grid
    rows, cols = world.clearance_m.shape
    west, south = world.origin_m
    frame = (west, west + cols * world.cell_m, south, south + rows * world.cell_m)
    colours = matplotlib.colors.ListedColormap([_ROCK, "white"])
    plan.imshow(world.clearance_m > 0, origin="lower", extent=frame, cmap=colours)
    path, times = np.array(episode.path_cm) / 100, sample_times(episode, task.control_s)
    if np.isfinite(task.region_m):
        row, col = np.nonzero(grid.in_plan(grid.reachable))
        cells = grid.origin_m + (np.column_stack([col, row]) + 0.5) * grid.cell_m
        plan.plot(*cells.T, ".", ms=2, color=_CELL, zorder=1)
        low, high = path.min(axis=0) - _MARGIN_M, path.max(axis=0) + _MARGIN_M
        plan.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    plan.plot(*path[0], "o", color=_INK, ms=6)
    return plan.scatter(*path.T, c=times, cmap="viridis", s=7, zorder=2)


def _draw_coverage(curve: Any, control_s: float, bound: Bound, episodes: list[Episode]) -> None:
    most = np.array(bound.most) / bound.cells
    curve.step([*bound.time_s], most, where="pre", color=_INK, label="no robot can have seen more")
    for episode in episodes:
        share = np.array(episode.seen) / bound.cells
        curve.plot(sample_times(episode, control_s), share, color=_BLUE, lw=0.8, alpha=0.5)
    curve.plot([], [], color=_BLUE, label=f"the oracle's tour, {len(episodes)} seeds")
    curve.axhline(0.9, color=_TARGET, lw=1, ls=":", label="the paper's target")
    curve.set(xlabel="time, s", ylabel="coverage", ylim=(0, 1.02), xlim=(0, bound.time_s[-1]))
    curve.legend(frameon=False)
