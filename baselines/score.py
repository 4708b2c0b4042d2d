"""Score results files: recompute every figure, reject what is impossible: `python -m baselines.score FILE ...`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from baselines import result_file
from baselines.bounds import bound_of
from baselines.checks import episode_faults, file_faults
from baselines.confinement import Limits
from baselines.driven import note_driven
from baselines.errors import BaselineError, RejectedError, run_command
from baselines.evaluate import print_table
from baselines.protocol import SEEDS
from baselines.reference import reference_of
from baselines.rerun import drive_again
from baselines.result_file import Episode, Head, read_results


def score(
    path: Path, rerun: int = 0, policy: str | None = None, limits: Limits | None = None, jobs: int = 1
) -> tuple[Head, list[Episode]]:
    """Check a results file; return what it holds.

    Parameters
    ----------
    path : Path
    rerun : int
        Number of episodes to drive again in a confined process. They must come out the same, which holds only on the
        same kind of machine with the same versions. A file of the benchmark whose episodes all do is noted as such.
    policy, limits, jobs
        As `baselines.rerun.drive_again` takes them.

    Raises
    ------
    RejectedError
        With the episode's seed, the figure, and the limit that it breaks.
    BaselineError
        If it is not a results file, is cut short, or its world is not on this machine.
    """
    head, episodes = read_results(path)
    check(path, head, episodes)
    if rerun:
        held = drive_again(path, head, episodes[:rerun], policy, limits or Limits(), jobs)
        print(f"{path}: {min(rerun, len(episodes))} episodes driven again, the policy {held}")
        if rerun >= len(episodes):
            note_driven(path, result_file.RESULTS, head, episodes)
    return head, episodes


def check(path: Path, head: Head, episodes: list[Episode]) -> None:
    """Reject what the environment does not allow; see `score`."""
    reference = reference_of(head.env)
    for reason in file_faults(head, episodes, reference.env):
        raise RejectedError(f"{path}: {reason}")
    bound = bound_of(head.env, head.world_sha256)
    for number, episode in enumerate(episodes):
        for reason in episode_faults(episode, number, reference, bound):
            raise RejectedError(f"{path}: seed {episode.seed}: {reason}")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m baselines.score", description=__doc__)
    parser.add_argument("results", nargs="+", type=Path)
    parser.add_argument("--rerun", default="0", metavar="N", help="drive the first N episodes again, or `all`")
    parser.add_argument("--policy", help="what drives them: a file NAME.safetensors or module:Class")
    parser.add_argument("--jobs", type=int, default=1, help="processes; each holds the world")
    parser.add_argument("--memory-gb", type=float, default=4.0, help="limit on the policy's memory")
    parser.add_argument("--time-s", type=float, default=7200.0, help="limit on the policy's own time")
    arguments = parser.parse_args()
    rerun = len(SEEDS) if arguments.rerun == "all" else _whole(arguments.rerun)
    if arguments.jobs < 1 or not 0.5 <= arguments.memory_gb <= 1024 or not 1 <= arguments.time_s <= 1e6:
        raise BaselineError(
            f"jobs = {arguments.jobs}, memory-gb = {arguments.memory_gb:g}, time-s = {arguments.time_s:g}: "
            "want 1 or more, 0.5 to 1024, and 1 to 1000000"
        )
    limits = Limits(round(arguments.memory_gb * 2**30), arguments.time_s)
    for path in arguments.results:
        head, episodes = score(path, rerun, arguments.policy, limits, arguments.jobs)
        print_table(head, episodes, rerun >= len(episodes))


def _whole(text: str) -> int:
    if not text.isdecimal() or int(text) > len(SEEDS):
        raise BaselineError(f"rerun = {text}: want 0 to {len(SEEDS)}, or all")
    return int(text)


if __name__ == "__main__":
    sys.exit(run_command("score", main))
