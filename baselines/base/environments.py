"""The environments that policies are compared in: the ones that ship, and a user's own mines."""

from __future__ import annotations

import re

import gymnasium
from gymnasium.envs.registration import EnvSpec

import minexplore
from baselines.base.errors import BaselineError
from minexplore.envs.vector import MineVectorEnv
from minexplore.splits import mine_name
from minexplore.world import find_world, load_world

BENCHMARK = tuple(env_id for env_id, kwargs in minexplore.WORLDS.items() if "world" in kwargs)
_JUDGED = re.compile(r"(?:.+-)?(validation|test|variants)-\d{4}", re.ASCII)
_ENTRY_POINTS = ("minexplore.backends:make_vector_env", "minexplore.envs.vector:MineVectorEnv")


def known_ids() -> list[str]:
    """Return all registered ids with a world: the benchmark's, then own mines and other registered tasks."""
    ids = [env_id for env_id, spec in gymnasium.registry.items() if _is_task(spec)]
    return sorted(ids, key=lambda env_id: (env_id not in BENCHMARK, env_id))


def _is_task(spec: EnvSpec) -> bool:
    return spec.vector_entry_point in _ENTRY_POINTS and "world" in spec.kwargs and "goal" not in spec.kwargs


def find_id(name: str) -> str:
    """Return the registered id of a name: the id itself, or `NAME` for `MineXplore/NAME-v0`.

    Raises
    ------
    BaselineError
        If there is none; the message lists the ids that can be used.
    """
    known = known_ids()
    for env_id in (name, f"MineXplore/{name}-v0"):
        if env_id in known:
            return env_id
    named = [env_id for env_id in known if env_id not in minexplore.FAMILY_MINES]
    family = "; of the generated family " if len(named) < len(known) else ""
    mines = f"MineXplore/Family-SPLIT-NUMBER-v0, {len(known) - len(named)} of them" if family else ""
    raise BaselineError(f"env = {name!r}: valid choices are {', '.join(named)}{family}{mines}")


def require_trainable(name: str) -> None:
    """Refuse to train in a mine that policies are judged by, or with another robot than the default one.

    These mines are of the splits validation and test, and variants of the embedded mine; the name in the world's
    record decides, so that another id or a moved folder changes nothing.

    Raises
    ------
    BaselineError
        Naming the environment, the world and its split.
    """
    env_id = find_id(name)
    robot = gymnasium.spec(env_id).kwargs.get("robot")
    if robot is not None:
        raise BaselineError(f"{env_id}: robot = {robot!r:.60}: only policies of the default robot are trained")
    try:
        world = load_world(find_world(gymnasium.spec(env_id).kwargs["world"]))
    except (FileNotFoundError, ValueError) as error:
        raise BaselineError(f"{env_id}: {error}") from error
    judged = _JUDGED.fullmatch(world.record["name"])
    if judged:
        raise BaselineError(
            f"{env_id}: world {world.record['name']} is of the split {judged[1]}, which nothing is trained in"
        )


def built_ids(split: str, count: int) -> list[str]:
    """Return the ids of the first mines of a split.

    Raises
    ------
    BaselineError
        If one of them is not built; the message says how to build it.
    """
    ids = [f"MineXplore/Family-{mine_name(split, number)}-v0" for number in range(count)]
    absent = [env_id for env_id in ids if env_id not in minexplore.FAMILY_MINES]
    if absent:
        raise BaselineError(
            f"{absent[0]}: not built; `python -m benchmarks worlds --count {count} --split {split}` builds it"
        )
    return ids


def short_name(env_id: str) -> str:
    """Return an id without namespace and version: `my-mine` for `MineXplore/my-mine-v0`."""
    return env_id.rpartition("/")[2].rpartition("-v")[0]


def make_env(name: str, robots: int, threads: int = 1) -> MineVectorEnv:
    """Return the vector environment of a registered id or its short name.

    Raises
    ------
    BaselineError
        If there is no such id, or its world is missing, damaged, or too narrow for the robot.
    """
    env_id = find_id(name)
    try:
        return MineVectorEnv(robots, threads=threads, **gymnasium.spec(env_id).kwargs)
    except (FileNotFoundError, ValueError) as error:
        raise BaselineError(f"{env_id}: {error}") from error


def world_of(name: str) -> str:
    """Return the hash of the world of an id or its short name; see `make_env` for errors."""
    env = make_env(name, 1)
    try:
        return str(env.world.record["world_sha256"])
    finally:
        env.close()
