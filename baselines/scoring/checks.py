"""What a results file must be, whoever wrote it: of its environment, of the protocol, and of a policy of its name.

Nothing here judges its figures. They are unverified until its episodes are driven again.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import gymnasium

from baselines.base.environments import known_ids, make_env
from baselines.base.errors import BaselineError
from baselines.base.result_file import Episode, Head
from baselines.base.statistics import sample_count
from baselines.policies.policy_lookup import RESERVED, known_sha256
from baselines.running.protocol import params_facts, seeds_of


@dataclass(frozen=True)
class Facts:
    """What an environment says of itself: world, task, robot, number of reachable cells, heights or none."""

    world_sha256: str
    task: dict[str, Any]
    robot: dict[str, Any]
    cells: int
    heights: bool
    flies: bool = False  # whether the robot does

    @property
    def max_steps(self) -> int:
        """Return the most steps of an episode."""
        return int(self.task["max_steps"])


def facts_of(env_id: str) -> Facts:
    """Return an environment's facts.

    Raises
    ------
    BaselineError
        If there is no environment of exactly this id, or its world is missing or damaged.
    """
    if env_id not in known_ids():  # a short name would miss the bound, and have a table of its own
        raise BaselineError(f"env = {env_id!r}: valid choices are {', '.join(known_ids())}")
    return _read_facts(env_id, repr(sorted(gymnasium.spec(env_id).kwargs.items())))


@functools.lru_cache(maxsize=16)
def _read_facts(env_id: str, arguments: str) -> Facts:
    """Read an environment's facts; `arguments` separates what was registered again by the same id."""
    env = make_env(env_id, 1)
    try:
        return Facts(
            world_sha256=env.world.record["world_sha256"],
            task=params_facts(env.task),
            robot=params_facts(env.robot),
            cells=env.robots.grid.total,
            heights=env.world.has_heights,
            flies=env.robot.FLIES,
        )
    finally:
        env.close()


def head_faults(head: Head, facts: Facts) -> Iterator[str]:
    """Yield what in a head contradicts its environment or the protocol."""
    if head.world_sha256 != facts.world_sha256:
        yield f"world {head.world_sha256[:12]} is not {head.env}'s, {facts.world_sha256[:12]}"
    yield from _params_faults(f"the task is not {head.env}'s", head.task, facts.task)
    yield from _params_faults(f"the robot is not {head.env}'s", head.robot, facts.robot)
    if head.cells != facts.cells:
        yield f"{head.cells} reachable cells, the world has {facts.cells}"
    yield from _seed_faults(head.seeds, seeds_of(head.env))


def name_faults(head: Head, facts: Facts) -> Iterator[str]:
    """Yield why a file of somebody else cannot have its policy's name: it is reserved, or another policy's.

    Names that differ in capitals alone are the same to a reader.
    """
    if head.policy.casefold() in RESERVED:
        yield f"policy {head.policy!r}: the name is reserved"
        return
    known = known_sha256(head.policy, facts.heights, facts.flies)
    if known is not None and known != head.policy_sha256:
        yield (
            f"policy {head.policy!r}: the name of another policy, whose hash is {known[:12]}, "
            f"not {head.policy_sha256[:12]}"
        )


def _seed_faults(seeds: list[int], wanted: tuple[int, ...]) -> Iterator[str]:
    missing, extra = sorted(set(wanted) - set(seeds)), sorted(set(seeds) - set(wanted))
    protocol = f"the protocol's are {wanted[0]} to {wanted[-1]}"
    if len(set(seeds)) < len(seeds):
        yield f"a seed comes twice; {protocol}, each once"
    elif missing or extra:
        yield f"seeds: {protocol}; missing {missing or 'none'}, extra {extra or 'none'}"
    elif seeds != list(wanted):
        yield f"seeds: {protocol}, in this order"


def _params_faults(message: str, claimed: dict[str, Any], true: dict[str, Any]) -> Iterator[str]:
    changed = [k for k in true if claimed.get(k) != true[k]] or [k for k in claimed if k not in true]
    if changed:
        yield f"{message}: {changed[0]} = {claimed.get(changed[0])}, it is {true.get(changed[0])}"


def episode_faults(episode: Episode, facts: Facts) -> Iterator[str]:
    """Yield why an episode has no curve of its environment: too many steps, or another number of samples."""
    samples = sample_count(episode.steps)
    if episode.steps > facts.max_steps:
        yield f"{episode.steps} steps, an episode has at most {facts.max_steps}"
    elif not samples == len(episode.seen) == len(episode.path_cm):
        yield (
            f"{len(episode.seen)} samples of coverage, {len(episode.path_cm)} places; "
            f"{episode.steps} steps have {samples}"
        )
