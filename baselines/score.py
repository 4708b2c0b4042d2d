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
from baselines.protocol import name_episode
from baselines.reference import reference_of
from baselines.rerun import drive_again
from baselines.result_file import Episode, Head, read_results
from baselines.split_file import Drive, is_of_split, read_drives, read_parts, require_one_policy
from baselines.statistics import as_text, estimate
from minexplore.splits import SIZES

_ALL = max(SIZES.values())  # episodes of a file at most: one in each mine of a split


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


def score_split(path: Path, rerun: int = 0, policy: str | None = None, limits: Limits | None = None) -> list[Drive]:
    """Check a file of a split, whole or in part, mine by mine; return what it holds.

    Parameters
    ----------
    path : Path
    rerun : int
        Number of mines to drive again in a confined process.
    policy, limits
        As `baselines.rerun.drive_again` takes them.

    Raises
    ------
    RejectedError
        With the mine, the figure, and the limit that it breaks.
    BaselineError
        If it is no results file of one policy with one episode a mine, or a mine is not built on this machine.
    """
    drives = read_drives(path)
    require_one_policy(path, drives)
    for head, episode in drives:
        check(path, head, [episode])
    for head, episode in drives[:rerun]:
        held = drive_again(path, head, [episode], policy, limits or Limits())
    if rerun:
        print(f"{path}: {min(rerun, len(drives))} mines driven again, the policy {held}")
        if rerun >= len(drives):
            note_driven(path, result_file.RESULTS, drives[0][0], [episode for _, episode in drives])
    return drives


def print_split(drives: list[Drive]) -> None:
    """Print the share of the cells that a policy has seen of the mines of a split."""
    share = estimate([episode.seen[-1] / head.cells for head, episode in drives])
    mines = f"{len(drives)} mines from {drives[0][0].env} to {drives[-1][0].env}"
    print(f"{drives[0][0].policy} in {mines}: interquartile mean (95 % interval)")
    print(f"  {'coverage at the end':26} {as_text('coverage at the end', share)}")


def check(path: Path, head: Head, episodes: list[Episode]) -> None:
    """Reject what the environment does not allow; see `score`."""
    reference = reference_of(head.env)
    mine = f"{head.env}: " if is_of_split(head) else ""  # one of many in its file
    for reason in file_faults(head, episodes, reference.env):
        raise RejectedError(f"{path}: {mine}{reason}")
    bound = bound_of(head.env, head.world_sha256)
    for number, episode in enumerate(episodes):
        for reason in episode_faults(episode, number, reference, bound):
            raise RejectedError(f"{path}: {name_episode(head.env, episode.seed)}: {reason}")


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
    rerun = _ALL if arguments.rerun == "all" else _whole(arguments.rerun)
    if arguments.jobs < 1 or not 0.5 <= arguments.memory_gb <= 1024 or not 1 <= arguments.time_s <= 1e6:
        raise BaselineError(
            f"jobs = {arguments.jobs}, memory-gb = {arguments.memory_gb:g}, time-s = {arguments.time_s:g}: "
            "want 1 or more, 0.5 to 1024, and 1 to 1000000"
        )
    limits = Limits(round(arguments.memory_gb * 2**30), arguments.time_s)
    for path in arguments.results:
        if any(is_of_split(head) for head, _ in read_parts(path)):
            print_split(score_split(path, rerun, arguments.policy, limits))
            continue
        head, episodes = score(path, rerun, arguments.policy, limits, arguments.jobs)
        print_table(head, episodes, rerun >= len(episodes))


def _whole(text: str) -> int:
    if not text.isascii() or not text.isdecimal() or len(text) > 4 or int(text) > _ALL:
        raise BaselineError(f"rerun = {text}: want 0 to {_ALL}, or all")
    return int(text)


if __name__ == "__main__":
    sys.exit(run_command("score", main))
