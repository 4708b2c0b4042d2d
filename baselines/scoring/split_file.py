"""Results on a split: the results file of each mine, one after the other in one file."""

from __future__ import annotations

import io
from pathlib import Path

from baselines.base.errors import BaselineError
from baselines.base.result_file import RESULTS, Episode, Head, chain, parse_results, read_text, replace_text
from minexplore.splits import SIZES, mine_name

Drive = tuple[Head, Episode]  # the one episode of a mine

_BEGIN = '{"format":'
_MINE = "MineXplore/Family-"


def split_folder(split: str) -> Path:
    """Return where results on a split are kept."""
    return RESULTS / f"Family-{split}"


def mine_id(split: str, number: int) -> str:
    """Return the id of a mine's environment: `MineXplore/Family-test-0007-v0`."""
    return f"{_MINE}{mine_name(split, number)}-v0"


def write_drives(path: Path, drives: list[Drive]) -> None:
    """Write a file of a split; an interrupted write leaves the previous file in place."""
    replace_text(path, "".join(chain(head, [episode]) for head, episode in drives))


def read_parts(path: Path) -> list[tuple[Head, list[Episode]]]:
    """Return the head and the episodes of each results file in a file: of a split there is one for each mine.

    Raises
    ------
    BaselineError
        If a part is no results file, or there are too many parts.
    """
    parts: list[list[str]] = []
    for line in io.StringIO(read_text(path), newline="\n"):
        if line.startswith(_BEGIN) or not parts:
            parts.append([])
        parts[-1].append(line)
    if not 1 <= len(parts) <= max(SIZES.values()):
        raise BaselineError(f"{path}: {len(parts)} mines: want 1 to {max(SIZES.values())}")
    return [parse_results(path, "".join(part)) for part in parts]


def is_of_split(head: Head) -> bool:
    """Return whether a head is of a mine of a split."""
    return head.env.startswith(_MINE)


def split_of(head: Head) -> str:
    """Return the split of the mine of a head."""
    return head.env.removeprefix(_MINE).partition("-")[0]


def read_drives(path: Path) -> list[Drive]:
    """Return the mines' heads and episodes.

    Raises
    ------
    BaselineError
        If it cannot be read, or a mine has another number of episodes than one.
    """
    drives = []
    for head, episodes in read_parts(path):
        if len(episodes) != 1:
            raise BaselineError(f"{path}: {len(episodes)} episodes in {head.env}: want 1")
        drives.append((head, episodes[0]))
    return drives


def require_one_policy(path: Path, drives: list[Drive]) -> None:
    """Refuse a file of several policies or splits, or in which a mine comes twice.

    Raises
    ------
    BaselineError
        Naming the number of policies, the splits, or the mine.
    """
    policies = {(head.policy, head.policy_sha256) for head, _ in drives}
    if len(policies) > 1:
        raise BaselineError(f"{path}: results of {len(policies)} policies: want one")
    splits = sorted({split_of(head) for head, _ in drives})
    if len(splits) > 1:
        raise BaselineError(f"{path}: mines of {' and '.join(splits)}: want those of one split")
    found: set[str] = set()
    for head, _ in drives:
        if head.env in found:
            raise BaselineError(f"{path}: {head.env} comes twice")
        found.add(head.env)


def require_whole(path: Path, drives: list[Drive], split: str) -> None:
    """Refuse a file that is not of one policy in all mines of a split, each once and in order.

    Raises
    ------
    BaselineError
        Naming the first mine that is not the one that should stand there.
    """
    require_one_policy(path, drives)
    found = [head.env for head, _ in drives]
    for number in range(SIZES[split]):
        if number >= len(found) or found[number] != mine_id(split, number):
            there = found[number] if number < len(found) else "nothing"
            raise BaselineError(
                f"{path}: {there} where {mine_id(split, number)} is due; a split has {SIZES[split]} mines"
            )
    if len(found) > SIZES[split]:
        raise BaselineError(f"{path}: {len(found)} mines: want {SIZES[split]}")
