"""Bound and tour of environments: `python -m baselines.oracle`; bounds.json, results of the tour, and pictures."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import numpy as np

from baselines.base.environments import BENCHMARK, find_id, make_env
from baselines.base.errors import BaselineError, run_command
from baselines.base.progress import progress_bar
from baselines.base.result_file import Episode, Head, line_sha256, read_results, result_path, write_results
from baselines.evaluate import is_current
from baselines.oracle.bound import best_walk
from baselines.oracle.figure import draw_oracle
from baselines.oracle.network import TimeNetwork
from baselines.oracle.other_robots import network_of
from baselines.oracle.spans import tour_over_spans
from baselines.oracle.tour import OracleTour, plan_tour
from baselines.running.protocol import SEEDS, head_of, run_episodes
from baselines.scoring.bounds import Bound, read_bounds, write_bound
from minexplore.envs.vector import MineVectorEnv
from minexplore.physics.robot import RobotParams

LABEL = "oracle-tour"
_BANDS = 150  # of the horizon; shorter bands give a closer bound and a harder problem
_TIMES_S = (0, 10, 20, 30, 45, 60, 90, 120, 150, 200, 250, 300, 350, 400, 450, 500, 550, 600)
_SHOWN_S = (60, 300)  # the leaderboard's; of robots without a tour no other times are asked for, and a late one is hard
# Of the horizon: a tour is planned for each, as turning takes time, and the best is kept.
_BUDGETS = (1.0, 0.92, 0.85, 0.78, 0.7, 0.62)


def renew(env_id: str, seeds: list[int], limit_s: float, picture: Path) -> None:
    """Bring an environment's bound, tour and picture up to date; what is current is kept.

    Only the default robot has a tour and a picture.
    """
    env = make_env(env_id, len(seeds), os.cpu_count() or 1)
    head = head_of(env_id, env, LABEL, OracleTour(1, env.task, env.robot, np.zeros((1, 2))), seeds)
    tours = isinstance(env.robot, RobotParams)
    times = _times(env, _TIMES_S if tours else _SHOWN_S)
    known, results = _known_bound(env_id, head, times), result_path(LABEL, env_id)
    if not tours:
        _renew_bound(env_id, env, known, times, limit_s)
        return
    bounded, driven = len(known.time_s) == len(times), is_current(results, head)
    network = None if bounded and driven else network_of(env.robots, times[-1] / _BANDS)
    bound = known if network is None else _bound(env_id, network, known, times, limit_s)
    if network is not None and not driven:
        write_results(results, head, _tour(env_id, env, network, seeds, limit_s))
    episodes = read_results(results)[1]
    if network is not None or not picture.is_file():
        draw_oracle(env_id, env, bound, episodes, picture)
    env.close()
    reached = float(np.mean([e.seen[-1] for e in episodes]))
    print(
        f"{env_id}: at {bound.time_s[-1]:g} s no robot can have seen more than {bound.most[-1]} of {bound.cells} "
        f"cells ({bound.most[-1] / bound.cells:.1%}); the tour saw {reached:.0f} ({reached / bound.cells:.1%})"
        f"{'; both were current' if network is None else ''}",
        flush=True,
    )


def _renew_bound(env_id: str, env: MineVectorEnv, known: Bound, times: list[float], limit_s: float) -> None:
    """Bring the bound of a robot beside the default one up to date."""
    current = len(known.time_s) == len(times)
    network = None if current else network_of(env.robots, times[-1] / _BANDS)
    bound = known if network is None else _bound(env_id, network, known, times, limit_s)
    env.close()
    print(
        f"{env_id}: at {bound.time_s[-1]:g} s no robot can have seen more than {bound.most[-1]} of {bound.cells} cells "
        f"({bound.most[-1] / bound.cells:.1%}){'; it was current' if current else ''}",
        flush=True,
    )


def _times(env: MineVectorEnv, times_s: tuple[int, ...]) -> list[float]:
    """Return the times, s, at which a bound is computed: those up to the horizon, and the horizon."""
    horizon = env.task.max_steps * env.task.control_s
    return [*(float(t) for t in times_s if t < horizon), horizon]


def _known_bound(env_id: str, head: Head, times: list[float]) -> Bound:
    """Return the bound that is kept, whole or begun, or an empty one if that is of other inputs or other times."""
    inputs = line_sha256(head.model_copy(update={"versions": {}, "seeds": [0]}).model_dump_json())
    known = read_bounds().get(env_id)
    if known is not None and known.inputs_sha256 == inputs and known.time_s == times[: len(known.time_s)]:
        return known
    return Bound(world_sha256=head.world_sha256, inputs_sha256=inputs, cells=head.cells, time_s=[], most=[])


def _bound(env_id: str, network: TimeNetwork, known: Bound, times: list[float], limit_s: float) -> Bound:
    """Return a bound at all times; it is written after each of them, as the part that is done is a bound already."""
    progress, bound = progress_bar(f"{env_id}: bound", len(times), len(known.time_s), "times"), known
    for seconds in times[len(known.time_s) :]:
        most = max([best_walk(network, seconds, limit_s).most, *bound.most[-1:]])
        bound = bound.model_copy(update={"time_s": [*bound.time_s, seconds], "most": [*bound.most, most]})
        write_bound(env_id, bound)
        progress.update(1)
    progress.close()
    return bound


def _tour(env_id: str, env: MineVectorEnv, network: TimeNetwork, seeds: list[int], limit_s: float) -> list[Episode]:
    """Drive a tour for each budget and return the episodes of the one that sees most."""
    horizon = env.task.max_steps * env.task.control_s
    progress = progress_bar(f"{env_id}: tours", len(_BUDGETS) * len(seeds) * env.task.max_steps)
    tours = []
    for budget in _BUDGETS:
        plan = plan_tour if env.world.volume is None else tour_over_spans
        path = plan(network, best_walk(network, budget * horizon, limit_s), env.world)
        tour = OracleTour(len(seeds), env.task, env.robot, path)
        tours.append(list(run_episodes(env, tour, seeds, progress.update)))
    progress.close()
    return max(tours, key=lambda episodes: sum(e.seen[-1] for e in episodes))


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m baselines.oracle", description=__doc__)
    parser.add_argument("--env", nargs="*", help="ids, or NAME for MineXplore/NAME-v0; all that ship by default")
    parser.add_argument("--episodes", type=int, default=len(SEEDS), help="of the tour, a seed each")
    parser.add_argument("--limit", type=float, default=240.0, help="longest time of the solver for each problem, s")
    parser.add_argument("--pictures", type=Path, default=Path("docs"))
    arguments = parser.parse_args()
    if not 1 <= arguments.episodes <= 512 or not arguments.limit > 0:
        raise BaselineError(
            f"episodes = {arguments.episodes}, limit = {arguments.limit:g}: want 1 to 512 and more than 0 s"
        )
    for env_id in [find_id(name) for name in arguments.env or BENCHMARK]:
        picture = arguments.pictures / f"oracle-{result_path(LABEL, env_id).parent.name}.png"
        renew(env_id, list(range(arguments.episodes)), arguments.limit, picture)


if __name__ == "__main__":
    sys.exit(run_command("oracle", main))
