"""Evaluate a policy: `python -m baselines.evaluate --policy nearest-frontier --env MineXplore/ChileanMine-v0`."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from tqdm import tqdm

import minexplore
from baselines.errors import BaselineError, run_command
from baselines.oracle.record import bound_of
from baselines.policy import CLASSICAL, make_policy, policy_sha256
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


def _evaluate_all(seeds: list[int]) -> None:
    """Evaluate every classical policy, and every kept checkpoint where it was trained; done ones are passed over."""
    envs = [env for env, kwargs in minexplore.WORLDS.items() if "world" in kwargs]
    for env_id in envs:
        checkpoints = sorted(
            (RESULTS / "checkpoints").glob(f"{env_id.removeprefix('MineXplore/').split('-v')[0]}-*.safetensors")
        )
        for policy in [*CLASSICAL, *map(str, checkpoints)]:
            out = result_path(policy, env_id)
            if _is_current(out, env_id, policy):
                continue
            evaluate(policy, env_id, seeds, out)
            print_table(out)


def _is_current(out: Path, env_id: str, policy: str) -> bool:
    """Say whether results are of this world and of the policy as it is now."""
    if not out.is_file():
        return False
    head, _ = read_results(out)
    env = make_env(env_id, 1)
    same = head.world_sha256 == env.world.record["world_sha256"]
    now = policy_sha256(make_policy(policy, 1, env.task))
    env.close()
    return same and head.policy_sha256 == now


def result_path(policy_name: str, env_id: str) -> Path:
    """Return where a policy's results lie by default."""
    mine = env_id.removeprefix("MineXplore/")
    return RESULTS / mine / f"{Path(policy_name).stem}.jsonl"


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m baselines.evaluate", description=__doc__)
    parser.add_argument("--policy", help="a name, or a checkpoint NAME.safetensors")
    parser.add_argument("--env")
    parser.add_argument(
        "--all", action="store_true", help="all classical policies in all environments, where results lack"
    )
    parser.add_argument("--episodes", type=int, default=20)
    parser.add_argument("--seeds", type=int, nargs="*", help="one an episode; 0, 1, 2, ... by default")
    parser.add_argument("--out", type=Path, help="baselines/results/ENV/POLICY.jsonl by default")
    arguments = parser.parse_args()
    if not 1 <= arguments.episodes <= 512:
        raise BaselineError(f"episodes = {arguments.episodes}: want 1 to 512")
    seeds = arguments.seeds or list(range(arguments.episodes))
    if len(set(seeds)) < len(seeds) or min(seeds) < 0:
        raise BaselineError(f"seeds = {seeds}: want different ones, none below 0")
    if arguments.all:
        _evaluate_all(seeds)
        return
    if arguments.policy is None or arguments.env is None:
        raise BaselineError("say what to evaluate: --policy and --env, or --all")
    out = arguments.out or result_path(arguments.policy, arguments.env)
    evaluate(arguments.policy, arguments.env, seeds, out)
    print_table(out)


if __name__ == "__main__":
    sys.exit(run_command("evaluate", main))
