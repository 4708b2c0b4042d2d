"""Score results files: recompute every figure, reject what is impossible: `python -m baselines.score FILE ...`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from baselines.bounds import bound_of
from baselines.checks import episode_faults, head_faults
from baselines.environments import make_env
from baselines.errors import BaselineError, run_command
from baselines.evaluate import print_table
from baselines.policy import make_policy, policy_sha256
from baselines.protocol import run_episodes
from baselines.result_file import Episode, Head, chain, read_results


class RejectedError(BaselineError):
    """A results file claims what is impossible."""


def score(path: Path, rerun: int = 0) -> None:
    """Check a results file.

    Parameters
    ----------
    path : Path
    rerun : int
        Number of episodes to drive again, with the checkpoint beside the file or the policy that the head names. They
        must come out the same, which holds only on the same kind of machine with the same versions.

    Raises
    ------
    RejectedError
        With the episode's seed, the figure, and the limit that it breaks.
    BaselineError
        If it is not a results file, is cut short, or its world is not on this machine.
    """
    head, episodes = read_results(path)
    env = make_env(head.env, 1)
    try:
        for reason in head_faults(head, env):
            raise RejectedError(f"{path}: {reason}")
        bound = bound_of(head.env, head.world_sha256)
        for episode in episodes:
            for reason in episode_faults(head, episode, env, bound):
                raise RejectedError(f"{path}: seed {episode.seed}: {reason}")
    finally:
        env.close()
    if rerun:
        _drive_again(path, head, episodes[:rerun])


def _drive_again(path: Path, head: Head, episodes: list[Episode]) -> None:
    seeds = [episode.seed for episode in episodes]
    env = make_env(head.env, len(seeds))
    checkpoint = path.with_name(f"{head.policy}.safetensors")
    name = str(checkpoint) if checkpoint.is_file() else head.policy
    policy = make_policy(name, len(seeds), env.task, env.robot)
    if policy_sha256(policy) != head.policy_sha256:
        raise RejectedError(
            f"{path}: policy {head.policy} is {policy_sha256(policy)[:12]} here, not {head.policy_sha256[:12]}"
        )
    again = list(run_episodes(env, policy, seeds))
    env.close()
    if chain(head, again) != chain(head, episodes):
        bare = [[e.model_copy(update={"previous": ""}) for e in some] for some in (again, episodes)]
        differs = next(ours.seed for ours, theirs in zip(*bare, strict=True) if ours != theirs)
        raise RejectedError(f"{path}: seed {differs}: driven again, the episode comes out differently")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m baselines.score", description=__doc__)
    parser.add_argument("results", nargs="+", type=Path)
    parser.add_argument("--rerun", type=int, default=0, metavar="N", help="drive the first N episodes again")
    arguments = parser.parse_args()
    if arguments.rerun < 0:
        raise BaselineError(f"rerun = {arguments.rerun}: want 0 or more")
    for path in arguments.results:
        score(path, arguments.rerun)
        print_table(path)


if __name__ == "__main__":
    sys.exit(run_command("score", main))
