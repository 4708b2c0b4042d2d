"""The simulator beside the environment: `python -m baselines.pages.simulator --mines 4`.

It writes docs/evidence/parts/graph-simulator.md.

The same rules explore the first mines of the validation split in the simulator, and their kept results give what they
saw in the environment with physics (`python -m baselines.split --split validation --policy ...`). The decisions of a
trained network are timed in the first of these mines.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from baselines.base.environments import make_env
from baselines.base.errors import BaselineError, run_command
from baselines.base.markdown import markdown_table, write_table
from baselines.explorers.graph_explorer import GraphExplorer, Situation
from baselines.explorers.tour import DepthFirst, FrontierTour, TwoLevel
from baselines.graph.choosing import Rule
from baselines.graph.features import Context
from baselines.graph.policy import GraphPolicy
from baselines.graph.training.mines import simulate
from baselines.graph.training.watch import drive
from baselines.policies.policy_source import require_checkpoint
from baselines.scoring.split_file import mine_id, read_drives, split_folder
from minexplore.physics.robot import RobotParams
from minexplore.splits import SIZES
from minexplore.task import TaskParams

_PAGE = Path("docs/evidence/parts/graph-simulator.md")
_SPLIT, _ROBOTS = "validation", 4
_TIMED_STEPS = 3000
_RULES: dict[str, type[GraphExplorer]] = {
    "baselines.explorers.graph_explorer.GraphExplorer": GraphExplorer,
    "frontier-tour": FrontierTour,
    "depth-first": DepthFirst,
    "two-level": TwoLevel,
}


def classical_rule(kind: type[GraphExplorer]) -> Rule:
    """Return how a classical graph explorer chooses, as a rule of the simulator."""
    explorer = kind(1, TaskParams(), RobotParams())

    def rule(situation: Situation, context: Context) -> int:
        if situation.present >= 0 and context.held_s < explorer.commit_steps * TaskParams().control_s:
            return situation.present
        return explorer.choose(situation)

    return rule


def environment_shares(policy: str) -> dict[str, float]:
    """Return the share of each mine that a policy's kept results saw in the environment, by id."""
    path = split_folder(_SPLIT) / f"{policy}.jsonl"
    part = path.with_suffix(".part")
    kept = [drive for file in (part, path) if file.is_file() for drive in read_drives(file)]
    return {head.env: episode.seen[-1] / head.cells for head, episode in kept}


class TimedPolicy(GraphPolicy):
    """Notes how long each decision takes, and the step that it is made in with its map and its graph, s."""

    def __init__(self, *arguments: Any) -> None:
        """Take the arguments of `GraphPolicy`."""
        super().__init__(*arguments)
        self.decisions_s: list[float] = []
        self.steps_s: list[float] = []

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        before, start = len(self.decisions_s), time.perf_counter()
        commands = super().act(observation, info)
        if len(self.decisions_s) > before:
            self.steps_s.append(time.perf_counter() - start)
        return commands

    def _choose(self, driver: Any, situation: Situation) -> int:
        start = time.perf_counter()
        chosen = super()._choose(driver, situation)
        self.decisions_s.append(time.perf_counter() - start)
        return chosen


def time_decisions(path: Path, env_id: str, steps: int = _TIMED_STEPS) -> TimedPolicy:
    """Drive one robot by a network for some steps, and return the policy with its times."""
    env = make_env(env_id, 1)
    try:
        policy = TimedPolicy(path, 1, env.task, env.robot)
        observation, info = env.reset(seed=0)
        for _ in range(steps):
            observation, _, _, _, info = env.step(policy.act(observation, info))
        return policy
    finally:
        env.close()


def compare(mines: int, path: Path | None) -> str:
    """Return the tables: shares seen in the simulator and in the environment, its speed, and the decisions' times."""
    ids = [mine_id(_SPLIT, number) for number in range(mines)]
    known = {policy: environment_shares(policy) for policy in _RULES}
    rows, simulated_s, used_s = [], 0.0, 0.0
    for policy, kind in _RULES.items():
        driven = [env_id for env_id in ids if env_id in known[policy]]
        for env_id in driven:
            sim, start = simulate(env_id, _ROBOTS), time.process_time()
            seen = drive(sim, classical_rule(kind), 0)
            used_s += time.process_time() - start
            simulated_s += _ROBOTS * sim.horizon_s
            here = f"{100 * np.mean(seen):.1f} ({100 * seen.min():.1f} to {100 * seen.max():.1f})"
            rows.append((policy.rpartition(".")[2], env_id, here, f"{100 * known[policy][env_id]:.1f}"))
    if not rows:
        raise BaselineError(
            f"{split_folder(_SPLIT)}: no results; `python -m baselines.split --split validation` makes some"
        )
    table = markdown_table(("rule", "mine", "simulator, %", "environment, %"), rows)
    speed = f"The simulator drove {simulated_s / used_s:.0f} s of a robot in a second of processor time."
    return f"{speed}\n\n{table}" + ("" if path is None else _times(path, ids[0]))


def _times(path: Path, env_id: str) -> str:
    """Return the page's part on the decisions of a network."""
    timed = time_decisions(path, env_id)
    rows = []
    for name, seconds in (("network", timed.decisions_s), ("step with map and graph", timed.steps_s)):
        figures = (np.median(seconds), np.quantile(seconds, 0.95), max(seconds))
        rows.append((name, *(f"{1000 * value:.1f}" for value in figures)))
    title = f"{len(timed.decisions_s):,} decisions of `{path.stem}` in {env_id}, one core, ms:"
    return f"\n## Decisions\n\n{title}\n\n{markdown_table(('', 'median', '95 %', 'most'), rows)}"


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m baselines.pages.simulator", description=__doc__)
    parser.add_argument("--mines", type=int, default=8)
    parser.add_argument("--network", type=Path, help="NAME.safetensors, whose decisions are timed")
    arguments = parser.parse_args()
    if not 1 <= arguments.mines <= SIZES[_SPLIT]:
        raise BaselineError(f"mines = {arguments.mines}: want 1 to {SIZES[_SPLIT]}")
    if arguments.network is not None:
        require_checkpoint(arguments.network)
    write_table(_PAGE, compare(arguments.mines, arguments.network))
    print(f"{_PAGE} is written")


if __name__ == "__main__":
    sys.exit(run_command("compare-graph", main))
