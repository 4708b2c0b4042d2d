"""Evaluate a policy: `python -m baselines.evaluate --policy nearest-frontier --env MineXplore/ChileanMine-v0`."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import minexplore
from baselines.base.environments import BENCHMARK, find_id, make_env
from baselines.base.errors import BaselineError, run_command
from baselines.base.result_file import (
    CHECKPOINTS,
    MOST_EPISODES,
    RESULTS,
    Episode,
    Head,
    read_results,
    require_place,
    result_path,
    write_results,
)
from baselines.base.statistics import as_text, figures
from baselines.explorers import EXPLORERS
from baselines.policies.policy_lookup import RESERVED, fits, make_policy, policy_label, trained_in
from baselines.running.parallel import drive
from baselines.running.protocol import SEEDS, head_of
from baselines.scoring.bounds import bound_of
from baselines.scoring.verified_runs import note_driven
from minexplore.envs.vector import MineVectorEnv
from pieces.work import HERE, Where, add_options, where_of

UNVERIFIED = "unverified: these are the file's own figures; `--rerun all` drives its episodes and verifies them"


def evaluate(
    policy_name: str, env_id: str, seeds: list[int], out: Path, where: Where = HERE
) -> tuple[Head, list[Episode]]:
    """Run a policy's episodes, write the results file, and return what it holds.

    Episodes of an explorer or a checkpoint are kept piece by piece: a file's hash does not cover all that the module of
    another policy may import.

    Raises
    ------
    BaselineError
        If policy or environment is unknown, they do not fit each other, or `out` is no place for a file.
    """
    require_place(out)
    env = make_env(env_id, 1)
    head = expected_head(policy_name, env_id, env, seeds)
    env.close()
    whole = None if ":" in policy_name else head.policy_sha256
    episodes = drive(policy_name, env_id, seeds, where, policy_sha256=whole)
    write_results(out, head, episodes)
    return head, episodes


def is_same(kept: Head, head: Head) -> bool:
    """Return whether two heads are of the same world, task, policy and seeds, whatever the versions."""
    return kept.model_copy(update={"versions": head.versions}) == head


def is_current(path: Path, head: Head) -> bool:
    """Return whether a results file has this head: the same world, task, policy and seeds, whatever the versions."""
    if not path.is_file():
        return False
    try:
        kept, _ = read_results(path)
    except BaselineError:
        return False
    return is_same(kept, head)


def print_table(head: Head, episodes: list[Episode], verified: bool = True) -> None:
    """Print the figures of a policy's episodes, one a line, and whether the episodes were driven here."""
    print(f"{head.policy} in {head.env}, {len(episodes)} seeds: interquartile mean (95 % interval)")
    if not verified:
        print(UNVERIFIED)
    for name, figure in figures(head, episodes, bound_of(head.env, head.world_sha256)).items():
        some = f"   in {figure.count} of {len(episodes)}" if figure.count < len(episodes) else ""
        print(f"  {name:26} {as_text(name, figure)}{some}")


def evaluate_all(env_ids: list[str], seeds: list[int], where: Where) -> None:
    """Evaluate all classical policies and kept checkpoints whose results are not current.

    Of the checkpoints, those that were trained there, or in generated mines.

    Results of another world, task, policy or other seeds are replaced. The new ones count as driven here.
    """
    for env_id in env_ids:
        env = make_env(env_id, 1)
        names = [name for name in _policies_of(env_id) if fits(name, env.robot)]
        heads = {name: expected_head(name, env_id, env, seeds) for name in names}
        env.close()
        stale = [name for name, head in heads.items() if not is_current(result_path(head.policy, env_id), head)]
        for name in (name for name in stale if where.piece is None or where.piece.startswith(f"{name} in {env_id},")):
            out = result_path(heads[name].policy, env_id)
            print_table(*evaluate(name, env_id, seeds, out, where))
            if heads[name].policy not in RESERVED:
                note_driven(out, RESULTS, *read_results(out))
        print(f"{env_id}: {len(stale)} policies evaluated, the results of the others are current", flush=True)


def _policies_of(env_id: str) -> list[str]:
    kept = sorted(CHECKPOINTS.glob("*.safetensors"))
    return [*EXPLORERS, *(path.stem for path in kept if trained_in(path) in (env_id, minexplore.FAMILY))]


def expected_head(policy_name: str, env_id: str, env: MineVectorEnv, seeds: list[int]) -> Head:
    """Return the head of a policy's results as an evaluation would write it now."""
    policy = make_policy(policy_name, 1, env.task, env.robot, env.world.has_heights)
    return head_of(env_id, env, policy_label(policy_name), policy, seeds)


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m baselines.evaluate", description=__doc__)
    parser.add_argument("--policy", help="a name, module:Class, or a checkpoint NAME.safetensors")
    parser.add_argument("--env", help="an id, or NAME for MineXplore/NAME-v0; with --all, all that ship by default")
    parser.add_argument(
        "--all", action="store_true", help="evaluate all classical and kept policies whose results are not current"
    )
    parser.add_argument("--episodes", type=int, default=len(SEEDS))
    parser.add_argument("--seeds", type=int, nargs="*", help="one an episode; 0, 1, 2, ... by default")
    parser.add_argument("--out", type=Path, help="baselines/results/ENV/POLICY.jsonl by default")
    add_options(parser, min(os.cpu_count() or 1, 4))
    arguments = parser.parse_args()
    if not 1 <= arguments.episodes <= MOST_EPISODES:
        raise BaselineError(f"episodes = {arguments.episodes}: want 1 to {MOST_EPISODES}")
    seeds = arguments.seeds or list(range(arguments.episodes))
    if len(set(seeds)) < len(seeds) or not all(0 <= seed < 2**32 for seed in seeds) or len(seeds) > MOST_EPISODES:
        raise BaselineError(f"seeds = {seeds}: want at most {MOST_EPISODES} different ones, from 0 to 2^32 - 1")
    if arguments.all:
        evaluate_all([find_id(arguments.env)] if arguments.env else list(BENCHMARK), seeds, where_of(arguments))
        return
    if arguments.policy is None or arguments.env is None:
        raise BaselineError("nothing to evaluate: give --policy and --env, or --all")
    env_id = find_id(arguments.env)
    out = arguments.out or result_path(policy_label(arguments.policy), env_id)
    print_table(*evaluate(arguments.policy, env_id, seeds, out, where_of(arguments)))
    if arguments.out is None and arguments.policy in EXPLORERS:  # the project's own code
        note_driven(out, RESULTS, *read_results(out))


if __name__ == "__main__":
    sys.exit(run_command("evaluate", main))
