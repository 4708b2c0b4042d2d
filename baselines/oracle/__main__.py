"""Bound and tour of environments: `python -m baselines.oracle`; bounds.json, results of the tour, and pictures."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

import numpy as np
from tqdm import tqdm

import minexplore
from baselines.errors import BaselineError, run_command
from baselines.oracle.bound import best_walk
from baselines.oracle.figure import draw_oracle
from baselines.oracle.network import time_network
from baselines.oracle.record import BOUNDS, Bound, read_bounds
from baselines.oracle.tour import OracleTour, plan_tour
from baselines.protocol import Episode, chain, head_of, make_env, run_episodes
from baselines.results import RESULTS

_BANDS = 150  # of the horizon; shorter bands make a closer bound and a harder problem
_TIMES_S = (0, 10, 20, 30, 45, 60, 90, 120, 150, 200, 250, 300, 350, 400, 450, 500, 550, 600)
_BUDGETS = (
    1.0,
    0.92,
    0.85,
    0.78,
)  # of the horizon, for which a tour is planned: turning takes time that a bound does not
_SEEDS = list(range(20))


def settle(env_id: str, limit_s: float, pictures: Path) -> tuple[Bound, float]:
    """Compute an environment's bound, drive its oracle tour, write its results; return bound and the tour's cells."""
    env = make_env(env_id, len(_SEEDS), os.cpu_count() or 1)
    horizon = env.task.max_steps * env.task.control_s
    network = time_network(env.explorers, horizon / _BANDS)
    times = [t for t in _TIMES_S if t <= horizon]
    bar = tqdm([*times, *_BUDGETS], desc=env_id, disable=None)
    most: list[int] = []
    best: tuple[float, list[Episode], np.ndarray] = (-1.0, [], np.zeros((0, 2)))
    for ask in bar:
        if len(most) < len(times):
            most.append(max(best_walk(network, ask, limit_s).most, most[-1] if most else 0))
            continue
        path = plan_tour(network, best_walk(network, ask * horizon, limit_s), env.world)
        tour = OracleTour(len(_SEEDS), env.task, path)
        episodes = list(run_episodes(env, tour, _SEEDS, lambda n: None))
        reached = float(np.mean([e.seen[-1] for e in episodes]))
        if reached > best[0]:
            best = (reached, episodes, path)
            text = chain(head_of(env_id, env, "oracle-tour", tour, _SEEDS), episodes)
    bound = Bound(
        world_sha256=env.world.record["world_sha256"], cells=env.explorers.grid.total,
        time_s=[float(t) for t in times], most=most,
    )  # fmt: skip
    mine = env_id.removeprefix("MineXplore/")
    (RESULTS / mine).mkdir(parents=True, exist_ok=True)
    (RESULTS / mine / "oracle-tour.jsonl").write_text(text)
    draw_oracle(env_id, env, bound, best[1], pictures / f"oracle-{mine}.png")
    env.close()
    return bound, best[0]


def main() -> None:
    """Read the command line."""
    known = [env for env, kwargs in minexplore.WORLDS.items() if "world" in kwargs]
    parser = argparse.ArgumentParser(prog="python -m baselines.oracle", description=__doc__)
    parser.add_argument("--env", nargs="*", default=known)
    parser.add_argument("--limit", type=float, default=60.0, help="seconds for the solver, each time it is asked")
    parser.add_argument("--pictures", type=Path, default=Path("docs"))
    arguments = parser.parse_args()
    for env_id in arguments.env:
        if env_id not in known:
            raise BaselineError(f"env = {env_id!r}: valid choices are {', '.join(known)}")
    for env_id in arguments.env:
        bound, reached = settle(env_id, arguments.limit, arguments.pictures)
        BOUNDS.parent.mkdir(parents=True, exist_ok=True)
        bounds = {env: b.model_dump() for env, b in sorted((read_bounds() | {env_id: bound}).items())}
        BOUNDS.write_text(json.dumps(bounds, indent=1) + "\n")
        share = reached / bound.cells
        print(
            f"{env_id}: at {bound.time_s[-1]:g} s no robot can have seen more than {bound.most[-1]} of {bound.cells} "
            f"cells ({bound.most[-1] / bound.cells:.1%}); the tour saw {reached:.0f} ({share:.1%})"
        )


if __name__ == "__main__":
    sys.exit(run_command("oracle", main))
