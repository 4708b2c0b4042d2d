"""The picture of a bound and a tour: where it drove, and coverage over time between what was driven and what can be."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

from baselines.oracle.record import Bound
from baselines.protocol import Episode
from baselines.statistics import sample_times
from minexplore.vector import MineVectorEnv

matplotlib.use("Agg")
import matplotlib.pyplot as plt

_INK, _ROCK, _BLUE = "#222222", "#d9d4cc", "#1f5a94"


def draw_oracle(env_id: str, env: MineVectorEnv, bound: Bound, episodes: list[Episode], path: Path) -> None:
    """Write the picture: the first episode's way coloured by time, and its coverage below the bound."""
    world, task = env.world, env.task
    figure, (plan, curve) = plt.subplots(2, 1, figsize=(10, 7), height_ratios=(1.3, 1), layout="constrained")
    rows, cols = world.clearance_m.shape
    west, south = world.origin_m
    frame = (west, west + cols * world.cell_m, south, south + rows * world.cell_m)
    plan.imshow(
        world.clearance_m > 0, origin="lower", extent=frame, cmap=matplotlib.colors.ListedColormap([_ROCK, "white"])
    )
    grid = env.explorers.grid
    r, c = np.nonzero(grid.reachable)
    if np.isfinite(task.region_m):
        plan.plot(
            *(grid.origin_m + (np.column_stack([c, r]) + 0.5) * grid.cell_m).T, ".", ms=2, color="#9ec5e8", zorder=1
        )
    way, times = np.array(episodes[0].path_cm) / 100, sample_times(episodes[0], task.control_s)
    dots = plan.scatter(*way.T, c=times, cmap="viridis", s=7, zorder=2)
    plan.plot(*way[0], "o", color=_INK, ms=6)
    figure.colorbar(dots, ax=plan, label="time, s", shrink=0.8)
    margin = 15.0
    low, high = way.min(axis=0) - margin, way.max(axis=0) + margin
    if np.isfinite(task.region_m):
        plan.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    plan.set(title=f"{env_id}: the oracle's tour", xlabel="easting, m", ylabel="northing, m")
    curve.step(
        [*bound.time_s],
        np.array(bound.most) / bound.cells,
        where="pre",
        color=_INK,
        label="no robot can have seen more",
    )
    for episode in episodes:
        curve.plot(
            sample_times(episode, task.control_s), np.array(episode.seen) / bound.cells, color=_BLUE, lw=0.8, alpha=0.5
        )
    curve.plot([], [], color=_BLUE, label=f"the oracle's tour, {len(episodes)} seeds")
    curve.axhline(0.9, color="#b04a2f", lw=1, ls=":", label="the paper's target")
    curve.set(xlabel="time, s", ylabel="coverage", ylim=(0, 1.02), xlim=(0, bound.time_s[-1]))
    curve.legend(frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)
