"""Explorers in random mines with heights: how much of what is possible each of them sees in an episode.

The mines are built as one volume without visible rock. Kinds take turns: a decline that wanders, a spiral,
rooms on a seam that dips, and levels with ramps and a shaft. Each explorer drives one episode a mine. A bound that no
robot can pass is computed for each of the times.
"""

from __future__ import annotations

import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from baselines.base.statistics import interquartile_mean, sample_times
from baselines.explorers import EXPLORERS
from baselines.oracle.bound import best_walk
from baselines.oracle.other_robots import network_of
from baselines.policies.policy_lookup import make_policy
from baselines.running.protocol import SPLIT_SEEDS, run_episodes
from benchmarks.judged_cases import JudgedCases
from benchmarks.results import Row
from benchmarks.worlds.random_levels import random_legs
from minexplore.envs.vector import MineVectorEnv
from tests.heights import table
from tests.volumes import build_volume

TIMES_S = (60.0, 300.0, 600.0)
NAMES = (*EXPLORERS, "graph-cool-42")  # the classical ones and the learned one
_MINES, _BANDS, _LIMIT_S = 200, 100, 20.0  # of a bound: bands of the time, and seconds of the solver


def judge(seed: int) -> Row:
    """Return the shares of the bound, by explorer and time, in one mine, or why it has none."""
    kind, legs = random_legs(seed)
    row: Row = {"kind": kind}
    with tempfile.TemporaryDirectory(prefix="mine-") as folder:
        try:
            world = build_volume(table(legs), Path(folder))
            return row | _driven(world)
        except Exception as error:  # this mine fails and the others go on
            return row | {"problem": f"{type(error).__name__}: {error}".replace(folder, "")}


def _driven(world: Path) -> Row:
    env = MineVectorEnv(1, world=world)
    try:
        bounds = [best_walk(network_of(env.robots, time / _BANDS), time, _LIMIT_S).most for time in TIMES_S]
        row: Row = {"cells": env.robots.grid.total, "bounds": bounds}
        for name in NAMES:
            policy = make_policy(name, 1, env.task, env.robot, env.world.has_heights)
            episode = next(run_episodes(env, policy, list(SPLIT_SEEDS)))
            seen = np.interp(TIMES_S, sample_times(episode, env.task.control_s), episode.seen).tolist()
            row[name] = [round(some / most, 4) for some, most in zip(seen, bounds, strict=True)]
        return row
    finally:
        env.close()


def shares(rows: list[Row], name: str) -> str:
    """Return the interquartile means over mines of the shares of the bound that an explorer has seen, in percent."""
    values = np.array([row[name] for row in rows if name in row])
    return ", ".join(f"{100 * share:.1f}" for share in interquartile_mean(values)) if len(values) else ""


def note(rows: list[Row]) -> str:
    """Return the mines that were not driven, and why."""
    return "\n".join(f"- mine {row['case']}: {row['problem']}" for row in rows if "problem" in row)


EXPLORED = JudgedCases(
    name="explorers-with-heights",
    cases=range(_MINES),
    sample=20,
    judge=judge,
    holds=lambda row: "problem" not in row,
    groups=lambda row: [row["kind"]],
    of="mines",
    columns={
        "count": len,
        "cells": lambda rows: sum(row.get("cells", 0) for row in rows),
        **{name: partial(shares, name=name) for name in NAMES},
    },
    note=note,
    has_page=False,
)

if __name__ == "__main__":
    sys.exit(EXPLORED.run(__doc__))
