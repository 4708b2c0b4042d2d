"""Score results files: check what they hold, drive it again on request: `python -m baselines.score FILE ...`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from baselines.base import result_file
from baselines.base.errors import BaselineError, RejectedError, run_command
from baselines.base.result_file import Episode, Head, read_results
from baselines.base.statistics import as_text, estimate
from baselines.evaluate import UNVERIFIED, print_table
from baselines.running.protocol import name_episode
from baselines.sandbox.bubblewrap import Limits
from baselines.scoring.checks import episode_faults, facts_of, head_faults, name_faults
from baselines.scoring.rerun import Rerun, drive_again
from baselines.scoring.split_file import Drive, is_of_split, read_drives, read_parts, require_one_policy, split_of
from baselines.scoring.verified_runs import note_driven
from minexplore.splits import SIZES
from pieces.work import add_options, where_of

_ALL = max(SIZES.values())  # episodes of a file at most: one in each mine of a split


def score(path: Path, rerun: Rerun | None = None) -> tuple[Head, list[Episode]]:
    """Check a results file; return its head, and its episodes or those that were driven again.

    Parameters
    ----------
    path : Path
    rerun : Rerun, optional
        Which episodes to drive again. They must come out the same, which holds only on the same kind of machine with
        the same versions. A file of the benchmark whose episodes all do is noted as such.

    Raises
    ------
    RejectedError
        With the episode's seed, the figure, and the limit that it breaks.
    BaselineError
        If it is not a results file, is cut short, or its world is not on this machine.
    """
    head, episodes = read_results(path)
    check(path, head, episodes)
    require_name(path, head)
    if rerun is None or not rerun.count:
        return head, episodes
    again = drive_again(path, head, episodes[: rerun.count], rerun)
    print(f"{path}: {len(again)} of {len(episodes)} episodes driven again, all figures are equal")
    if len(again) < len(episodes) or rerun.trusted:
        return head, episodes
    note_driven(path, result_file.RESULTS, head, again)
    return head, again


def score_split(path: Path, rerun: Rerun | None = None) -> list[Drive]:
    """Check a file of a split, whole or in part, mine by mine; return what it holds, or what was driven again.

    Parameters
    ----------
    path : Path
    rerun : Rerun, optional
        Which mines to drive again.

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
    require_name(path, drives[0][0])
    if rerun is None or not rerun.count:
        return drives
    again = [(head, drive_again(path, head, [episode], rerun)[0]) for head, episode in drives[: rerun.count]]
    print(f"{path}: {len(again)} of {len(drives)} mines driven again, all figures are equal")
    if len(again) < len(drives) or rerun.trusted:
        return drives
    note_driven(path, result_file.RESULTS, again[0][0], [episode for _, episode in again])
    return again


def print_split(drives: list[Drive], verified: bool) -> None:
    """Print the share of the cells that a policy has seen of the mines of a split, and how many mines these are."""
    share = estimate([episode.seen[-1] / head.cells for head, episode in drives])
    split = split_of(drives[0][0])
    mines = f"{len(drives)} of the {SIZES[split]} mines of the split {split}"
    print(f"{drives[0][0].policy} in {mines}: interquartile mean (95 % interval)")
    if not verified:
        print(UNVERIFIED)
    print(f"  {'coverage at the end':26} {as_text('coverage at the end', share)}")


def check(path: Path, head: Head, episodes: list[Episode]) -> None:
    """Reject what is not of its environment; see `score`."""
    facts = facts_of(head.env)
    mine = f"{head.env}: " if is_of_split(head) else ""  # one of many in its file
    for reason in head_faults(head, facts):
        raise RejectedError(f"{path}: {mine}{reason}")
    for episode in episodes:
        for reason in episode_faults(episode, facts):
            raise RejectedError(f"{path}: {name_episode(head.env, episode.seed)}: {reason}")


def require_name(path: Path, head: Head) -> None:
    """Reject a file whose policy has a name that is reserved or another policy's."""
    for reason in name_faults(head, facts_of(head.env)):
        raise RejectedError(f"{path}: {reason}")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m baselines.score", description=__doc__)
    parser.add_argument("results", nargs="+", type=Path)
    parser.add_argument("--rerun", default="0", metavar="N", help="drive the first N episodes again, or `all`")
    parser.add_argument("--policy", help="what drives them: a file NAME.safetensors or module:Class")
    add_options(parser, 1, keeps=False)
    parser.add_argument("--trust-policy", action="store_true", help="run the policy unconfined, with your rights")
    parser.add_argument("--memory-gb", type=float, default=4.0, help="limit on the policy's memory")
    parser.add_argument("--time-s", type=float, default=7200.0, help="limit on the policy's own time")
    arguments = parser.parse_args()
    count = _ALL if arguments.rerun == "all" else _whole(arguments.rerun)
    if not 0.5 <= arguments.memory_gb <= 1024 or not 1 <= arguments.time_s <= 1e6:
        raise BaselineError(
            f"memory-gb = {arguments.memory_gb:g}, time-s = {arguments.time_s:g}: want 0.5 to 1024, and 1 to 1000000"
        )
    limits = Limits(round(arguments.memory_gb * 2**30), arguments.time_s)
    rerun = Rerun(count, arguments.policy, limits, where_of(arguments), arguments.trust_policy)
    if count and arguments.trust_policy:
        print("--trust-policy: policies run unconfined, with your rights, and verify nothing", file=sys.stderr)
    verifies = count if not arguments.trust_policy else 0
    for path in arguments.results:
        if any(is_of_split(head) for head, _ in read_parts(path)):
            drives = score_split(path, rerun)
            print_split(drives, verifies >= len(drives))
            continue
        head, episodes = score(path, rerun)
        print_table(head, episodes, verifies >= len(episodes))


def _whole(text: str) -> int:
    if not text.isascii() or not text.isdecimal() or len(text) > 4 or int(text) > _ALL:
        raise BaselineError(f"rerun = {text}: want 0 to {_ALL}, or all")
    return int(text)


if __name__ == "__main__":
    sys.exit(run_command("score", main))
