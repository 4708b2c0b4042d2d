"""Drive a results file's episodes again from its policy."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from baselines.base.errors import BaselineError, RejectedError
from baselines.base.result_file import RESULTS, Episode, Head
from baselines.explorers import EXPLORERS
from baselines.policies.policy_lookup import RESERVED, find_checkpoint, policy_label
from baselines.running.parallel import drive
from baselines.running.protocol import name_episode
from baselines.sandbox.bubblewrap import Limits, require_sandbox
from baselines.sandbox.confined import Confined
from baselines.sandbox.policy_copy import copy_policy
from baselines.scoring.split_file import read_parts
from baselines.scoring.verified_runs import was_driven_here
from pieces.work import HERE, Where

_FIGURES = [key for key in Episode.model_fields if key != "previous"]
UNCONFINED = "--trust-policy runs it unconfined"


@dataclass(frozen=True)
class Rerun:
    """How to drive again.

    Attributes
    ----------
    count : int
        The first so many episodes, or mines of a split.
    policy : str, optional
        A file NAME.safetensors or `module:Class`; without it, the explorer or the checkpoint that the head names.
    limits : Limits
        Of a sandboxed policy.
    where : Where
        Each process with an environment has a process with the policy beside it. What is kept is not read: all that is
        verified is driven.
    trusted : bool
        Whether a stranger's policy runs unconfined, in the environment's process. It could change the figures there, so
        that nothing is verified.
    """

    count: int = 0
    policy: str | None = None
    limits: Limits = field(default_factory=Limits)
    where: Where = HERE
    trusted: bool = False


def drive_again(path: Path, head: Head, episodes: list[Episode], how: Rerun) -> list[Episode]:
    """Drive episodes again; return those that were driven, which are equal.

    The project's own explorers run as they are. All else is a stranger's: its hash is compared before anything of it
    runs, and it runs in a sandbox, unless it is trusted.

    Parameters
    ----------
    path : Path
        The results file, which errors name and beside which a checkpoint may lie.
    head : Head
    episodes : list of Episode
    how : Rerun

    Raises
    ------
    RejectedError
        If the policy is another than the head says, or an episode comes out differently.
    BaselineError
        If there is no such policy, it fails, it exceeds its limits, or this system has no sandbox.
    """
    name, seeds = _find_policy(path, head, how.policy), [episode.seed for episode in episodes]
    try:
        again = drive(name, head.env, seeds, how.where, _admit(name, head, how))
    except BaselineError as error:
        raise type(error)(f"{path}: {error}") from error
    compare(path, head, episodes, again)
    return again


def _admit(name: str, head: Head, how: Rerun) -> Confined | None:
    """Return how a policy is confined, None if it is not; refuse one of another hash."""
    if name in EXPLORERS:
        return None  # `score` compared its hash, as it has an explorer's name
    if not how.trusted:
        try:
            require_sandbox()
        except BaselineError as error:
            raise BaselineError(f"policy {name} of somebody else needs a sandbox: {error}; {UNCONFINED}") from error
        return Confined(how.limits, head.policy_sha256)
    with TemporaryDirectory(prefix="policy-") as folder:
        copy_policy(name, Path(folder), head.policy_sha256)
    return None


def compare(path: Path, head: Head, episodes: list[Episode], again: list[Episode]) -> None:
    """Refuse episodes that differ from those that were driven again, in any figure."""
    for ours, theirs in zip(again, episodes, strict=True):
        differs = [key for key in _FIGURES if getattr(ours, key) != getattr(theirs, key)]
        if differs:
            raise RejectedError(
                f"{path}: {name_episode(head.env, theirs.seed)}: driven again, the episode comes out differently "
                f"({differs[0]})"
            )


def _find_policy(path: Path, head: Head, policy: str | None) -> str:
    """Return the policy that a file's episodes are to be driven by; no file's text decides what code is imported."""
    if policy is not None:
        if policy_label(policy) != head.policy:
            raise RejectedError(f"{path}: results of {head.policy!r}, not of {policy_label(policy)!r}")
        return str(Path(policy).resolve()) if policy.endswith(".safetensors") else policy
    if head.policy in EXPLORERS:
        return head.policy
    beside = path.with_name(f"{head.policy}.safetensors")
    try:
        found = beside if beside.is_file() else find_checkpoint(head.policy)
    except BaselineError as error:
        raise BaselineError(f"{path}: {error}; --policy names a file or module:Class") from error
    if not found.is_file():
        raise BaselineError(f"{path}: policy {head.policy!r} is not here; --policy names a file or module:Class")
    return str(found.resolve())


def pending(results: Path) -> list[Path]:
    """Return the kept files whose present contents were not driven here, of policies that can be found by name."""
    found = []
    for path in sorted(results.glob("*/*.jsonl")):
        parts = read_parts(path)
        head, episodes = parts[0][0], [episode for _, part in parts for episode in part]
        if head.policy not in RESERVED and not was_driven_here(path, results, head, episodes):
            found.append(path)
    return found


if __name__ == "__main__":
    print(*pending(RESULTS), sep="\n")
