"""Episodes of a policy as pieces of work: they do not depend on what runs beside them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory

import gymnasium
from gymnasium.envs.registration import EnvSpec
from pydantic_core import to_json

from baselines.base.environments import make_env, world_of
from baselines.base.errors import BaselineError, RejectedError
from baselines.base.result_file import Episode
from baselines.policies.policy_lookup import make_policy
from baselines.running.protocol import run_episodes
from baselines.sandbox.bubblewrap import require_sandbox
from baselines.sandbox.confined import Confined, ConfinedPolicy
from pieces.results import PiecesError
from pieces.run import map_pieces
from pieces.work import KEPT, Where, Work, code_sha256

SEEDS_A_PIECE = 5  # robots of one environment, whose steps cost less together
MEMORY_GB = 1.0  # of a process with an environment


def drive(
    policy_name: str,
    env_id: str,
    seeds: list[int],
    where: Where,
    confined: Confined | None = None,
    policy_sha256: str | None = None,
) -> list[Episode]:
    """Run one episode of each seed and return the episodes in the order of the seeds.

    With `confined` the policy runs in a confined process beside each process with an environment, on any node. Episodes
    are kept, and those that are kept are not driven again, if the hash of the policy's code is given.

    Raises
    ------
    BaselineError
        If episodes failed; the reason of each is listed. It is a `RejectedError` if the policy is another one.
    """
    parts = [seeds[k : k + SEEDS_A_PIECE] for k in range(0, len(seeds), SEEDS_A_PIECE)]
    with _copies_removed(confined) as confined:
        work = Work(
            "episodes",
            partial(_drive_part, policy_name, gymnasium.spec(env_id), confined),
            list[Episode],
            code_of_episodes(),
            (policy_name, policy_sha256, facts_of_env(env_id)),
            KEPT if policy_sha256 else None,
            memory_gb=MEMORY_GB,
            label=lambda part: f"{policy_name} in {env_id}, seeds {part[0]} to {part[-1]}",
        )
        try:
            return [episode for part in map_pieces(work, parts, where) for episode in part]
        except PiecesError as error:
            kind = RejectedError if RejectedError.__name__ in str(error) else BaselineError
            raise kind(str(error)) from error


def code_of_episodes() -> str:
    """Return the hash of the code that drives episodes."""
    return code_sha256("baselines", "minexplore")


def facts_of_env(env_id: str) -> str:
    """Return a hash of an environment's world and settings."""
    return sha256(to_json([world_of(env_id), gymnasium.spec(env_id).kwargs], fallback=str)).hexdigest()


@contextmanager
def _copies_removed(confined: Confined | None) -> Iterator[Confined | None]:
    """Let copies of a policy lie in a folder that this process removes: a worker that is ended removes nothing."""
    if confined is None:
        yield None
        return
    with TemporaryDirectory(prefix="policy-") as folder:
        yield replace(confined, folder=Path(folder))


def _drive_part(policy_name: str, spec: EnvSpec, confined: Confined | None, seeds: list[int]) -> list[Episode]:
    gymnasium.registry.setdefault(spec.id, spec)
    env = make_env(spec.id, len(seeds))
    heights = env.world.has_heights
    try:
        if confined is None:
            policy = make_policy(policy_name, len(seeds), env.task, env.robot, heights)
            return list(run_episodes(env, policy, seeds))
        require_sandbox()  # of this node
        if confined.folder is not None:
            confined.folder.mkdir(exist_ok=True)
        with ConfinedPolicy(policy_name, len(seeds), env.task, env.robot, confined, heights) as driver:
            return list(run_episodes(env, driver, seeds))
    finally:
        env.close()
