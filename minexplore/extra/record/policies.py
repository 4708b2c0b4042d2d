"""What drives a robot while it is recorded."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np

from minexplore.envs.batches import observations_of
from minexplore.envs.env import MineEnv

# An observation (n,) and its info -> an action.
Drive = Callable[[np.ndarray, dict[str, Any]], np.ndarray]

# Of a source checkout; the environment's own wheel has none.
_EXPLORERS, _TO_GOAL = "baselines.policies.policy_lookup", "baselines.explorers.to_goal"
_ERRORS = "baselines.base.errors"
_OWN = ("ahead", "random")


# An observation and how many of its numbers are beams -> forward and turn.
Ahead = Callable[[np.ndarray, int], np.ndarray]


def spread_command(pair: np.ndarray, count: int) -> np.ndarray:
    """Return commands (count,) that go forward, the first of any robot's, and turn, the last."""
    return np.concatenate([pair[:1], np.zeros(count - 2, dtype=np.float32), pair[1:]])


def find_drive(name: str, env: MineEnv, seed: int, ahead: Ahead) -> Drive:
    """Return what a policy of this name does: `ahead`, `random`, or one that `baselines.evaluate` knows.

    Raises
    ------
    ValueError
        If there is none; the message lists the choices.
    """
    count, beams = env.robot.COMMANDS, env.task.beams
    if name == "ahead":
        return lambda observation, info: spread_command(ahead(observation, beams), count)
    if name == "random":
        rng = np.random.default_rng(seed)
        return lambda observation, info: rng.uniform(-1, 1, count).astype(np.float32)
    if find_spec(_EXPLORERS.partition(".")[0]) is None:
        raise ValueError(f"policy = {name!r}: valid choices are {', '.join(_OWN)}; explorers need a source checkout")
    drivers = importlib.import_module(_TO_GOAL).DRIVERS
    return _to_goal(name, env, drivers) if name in drivers else _explorer(name, env, seed)


def _explorer(name: str, env: MineEnv, seed: int) -> Drive:
    """Return one of the baselines; they drive many robots at a time."""
    found, errors = importlib.import_module(_EXPLORERS), importlib.import_module(_ERRORS)
    try:
        made = found.make_policy(name, 1, env.task, env.robot, env.world.has_heights)
    except errors.BaselineError as error:
        raise ValueError(str(error)) from error
    made.reset(np.arange(1), np.array([seed]))
    own = observations_of(env.task, env.robot).shape[0]  # an explorer sees no goal
    return lambda observation, info: _alone(made, observation[:own], info)


def _to_goal(name: str, env: MineEnv, drivers: dict[str, Any]) -> Drive:
    """Return one of the drivers to a goal."""
    if "goal" not in env.robots.rules.OPTIONS or env.robot.FLIES:
        raise ValueError(f"policy = {name!r}: want an id GoTo-..., and a robot with wheels")
    made = drivers[name](env.robots)
    return lambda observation, info: _alone(made, observation, info)


def _alone(policy: Any, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
    """Return the command of a policy of many robots to one."""
    row: np.ndarray = policy.act(observation[None], {key: np.array([value]) for key, value in info.items()})[0]
    return row
