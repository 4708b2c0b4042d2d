"""Drive to goals: `python -m baselines.goto --env ChileanMine --episodes 50`; without `--env` it writes a table."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from tqdm import tqdm

from baselines.base.environments import BENCHMARK, find_id
from baselines.base.errors import BaselineError, run_command
from baselines.base.markdown import markdown_table, write_table
from baselines.base.progress import progress_bar
from baselines.explorers.to_goal import DRIVERS
from minexplore.envs.vector import MineVectorEnv

_PAGE = Path("docs/evidence/parts/goto.md")
_TOGETHER = 10  # robots that drive at a time: each has the ways of its goal in memory
_MOST = 10_000
_RESAMPLES = 2000
_TITLES = ("driver", "success", "SPL", "time, s", "steps in contact", "way left at the end, m")


@dataclass(frozen=True)
class GoalEpisode:
    """One episode: whether the goal was reached, its SPL, and what it took.

    Attributes
    ----------
    success : bool
    spl : float
        Success weighted by path length, 0 to 1.
    time_s : float
        Until success or the episode's end.
    collisions : int
        Control steps in contact with rock.
    way_left_m : float
        Along the drifts, at the end.
    shortest_s : float
        The least time at full speed on the shortest way.
    """

    success: bool
    spl: float
    time_s: float
    collisions: int
    way_left_m: float
    shortest_s: float


def drive(env_id: str, driver: str, seeds: list[int], **changed: Any) -> list[GoalEpisode]:
    """Return the episodes of a driver, one a seed, in the seeds' order; `changed` are arguments of the environment.

    Raises
    ------
    BaselineError
        If the environment cannot be made, or its robot flies.
    """
    spec = gymnasium.spec(env_id.replace("/", "/GoTo-"))
    found: list[GoalEpisode] = []
    progress = progress_bar(f"{driver} in {spec.id}", len(seeds) * (spec.max_episode_steps or 1))
    for first in range(0, len(seeds), _TOGETHER):
        own = seeds[first : first + _TOGETHER]
        try:
            env = MineVectorEnv(len(own), **{**spec.kwargs, **changed})
        except (FileNotFoundError, ValueError) as error:
            raise BaselineError(f"{spec.id}: {error}") from error
        if env.robot.FLIES:
            raise BaselineError(f"{spec.id}: its robot flies; the drivers to a goal have wheels")
        found += _episodes(env, driver, own, progress)
        env.close()
    progress.close()
    return found


def _episodes(env: MineVectorEnv, driver: str, seeds: list[int], progress: tqdm) -> list[GoalEpisode]:
    observation, info = env.reset(seed=seeds)
    policy = DRIVERS[driver](env.robots)
    last: dict[int, GoalEpisode] = {}
    while len(last) < len(seeds):
        observation, _, terminated, truncated, info = env.step(policy.act(observation, info))
        progress.update(len(seeds) - len(last))
        for robot in np.flatnonzero(terminated | truncated).tolist():
            least_s = float(info["shortest_m"][robot]) / env.task.max_forward_mps
            numbers = (float(info[name][robot]) for name in ("spl", "time_s", "collisions", "way_left_m"))
            spl, time_s, collisions, left_m = numbers
            ended = GoalEpisode(bool(info["success"][robot]), spl, time_s, int(collisions), left_m, least_s)
            last.setdefault(robot, ended)  # a robot whose episode is over begins another one
    return [last[robot] for robot in range(len(seeds))]


def table(episodes: dict[str, list[GoalEpisode]]) -> str:
    """Return a row for each driver, and that of the bound: the shortest way of each episode at full speed."""
    least = [episode.shortest_s for episode in next(iter(episodes.values()))]
    rows = [("bound", "100.0 %", "1.000", _mean(least, 1), "0", "")]
    for driver, found in episodes.items():
        reached = [episode.time_s for episode in found if episode.success]
        rows.append(
            (
                driver,
                _mean([100.0 * episode.success for episode in found], 1, " %"),
                _mean([episode.spl for episode in found], 3),
                _mean(reached, 1),
                _mean([episode.collisions for episode in found], 1),
                _mean([episode.way_left_m for episode in found], 1),
            )
        )
    return markdown_table(_TITLES, rows)


def _mean(values: list[float], digits: int, unit: str = "") -> str:
    """Return a mean with its 95 % bootstrap interval."""
    if not values:
        return "never"
    found = np.array(values, dtype=float)
    drawn = np.random.default_rng(0).integers(len(found), size=(_RESAMPLES, len(found)))
    low, high = np.percentile(found[drawn].mean(axis=1), [2.5, 97.5])
    return f"{found.mean():.{digits}f}{unit} ({low:.{digits}f}-{high:.{digits}f})"


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m baselines.goto", description=__doc__)
    parser.add_argument("--env", nargs="*", help="ids of exploration, or NAME for MineXplore/NAME-v0, in whose mines")
    parser.add_argument("--driver", nargs="*", choices=list(DRIVERS), default=list(DRIVERS))
    parser.add_argument("--episodes", type=int, default=20, help="of the seeds 0, 1, 2, ...")
    arguments = parser.parse_args()
    if not 1 <= arguments.episodes <= _MOST:
        raise BaselineError(f"episodes = {arguments.episodes}: want 1 to {_MOST}")
    named = list(BENCHMARK) if arguments.env is None else [find_id(name) for name in arguments.env]
    parts = []
    for env_id in named:
        episodes = {name: drive(env_id, name, list(range(arguments.episodes))) for name in arguments.driver}
        heading = f"{env_id.replace('/', '/GoTo-')}, {arguments.episodes} episodes"
        parts.append(f"{heading}:\n\n{table(episodes)}")
        print(parts[-1], flush=True)
    if arguments.env is None:
        write_table(_PAGE, "\n".join(parts))
        print(f"{_PAGE} is written")


if __name__ == "__main__":
    sys.exit(run_command("goto", main))
