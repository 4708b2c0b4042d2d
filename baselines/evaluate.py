"""Evaluate a policy: `python -m baselines.evaluate --policy nearest-frontier --env MineXplore/ChileanMine-v0`."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from tqdm import tqdm

from baselines.errors import BaselineError, run_command
from baselines.oracle.record import bound_of
from baselines.policy import make_policy
from baselines.protocol import chain, head_of, make_env, run_episodes
from baselines.results import RESULTS, as_text, read_results
from baselines.statistics import figures


def evaluate(policy_name: str, env_id: str, seeds: list[int], out: Path) -> None:
    """Run a policy's episodes and write the results file.

    Raises
    ------
    BaselineError
        If policy or environment is unknown, or they do not fit each other.
    """
    env = make_env(env_id, len(seeds), os.cpu_count() or 1)
    policy = make_policy(policy_name, len(seeds), env.task)
    name = Path(policy_name).stem
    head = head_of(env_id, env, name, policy, seeds)
    bar = tqdm(total=len(seeds) * env.task.max_steps, desc=name, unit=" steps", disable=None)
    episodes = list(run_episodes(env, policy, seeds, bar.update))
    bar.close()
    env.close()
    out.parent.mkdir(parents=True, exist_ok=True)
    fresh = out.with_suffix(".new")
    fresh.write_text(chain(head, episodes))
    fresh.rename(out)


def print_table(path: Path) -> None:
    """Print what a results file says, a figure a line."""
    head, episodes = read_results(path)
    print(f"{head.policy} in {head.env}, {len(episodes)} seeds: interquartile mean (95 % interval)")
    for name, figure in figures(head, episodes, bound_of(head.env, head.world_sha256)).items():
        some = f"   in {figure.count} of {len(episodes)}" if figure.count < len(episodes) else ""
        print(f"  {name:26} {as_text(name, figure)}{some}")


def result_path(policy_name: str, env_id: str) -> Path:
    """Return where a policy's results lie by default."""
    mine = env_id.removeprefix("MineXplore/")
    return RESULTS / mine / f"{Path(policy_name).stem}.jsonl"


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m baselines.evaluate", description=__doc__)
    parser.add_argument("--policy", required=True, help="a name, or a checkpoint NAME.safetensors")
    parser.add_argument("--env", required=True)
    parser.add_argument("--episodes", type=int, default=20)
    parser.add_argument("--seeds", type=int, nargs="*", help="one an episode; 0, 1, 2, ... by default")
    parser.add_argument("--out", type=Path, help="baselines/results/ENV/POLICY.jsonl by default")
    arguments = parser.parse_args()
    if not 1 <= arguments.episodes <= 512:
        raise BaselineError(f"episodes = {arguments.episodes}: want 1 to 512")
    seeds = arguments.seeds or list(range(arguments.episodes))
    if len(set(seeds)) < len(seeds) or min(seeds) < 0:
        raise BaselineError(f"seeds = {seeds}: want different ones, none below 0")
    out = arguments.out or result_path(arguments.policy, arguments.env)
    evaluate(arguments.policy, arguments.env, seeds, out)
    print_table(out)


if __name__ == "__main__":
    sys.exit(run_command("evaluate", main))
