"""What drives a robot while it is recorded."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np

from minexplore.envs.env import MineEnv

# An observation (n,) and its info -> an action.
Drive = Callable[[np.ndarray, dict[str, Any]], np.ndarray]

# Of a source checkout; the environment's own wheel has none.
_EXPLORERS, _ERRORS = "baselines.policies.policy_lookup", "baselines.base.errors"
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
    return _explorer(name, env, seed)


def _explorer(name: str, env: MineEnv, seed: int) -> Drive:
    """Return one of the baselines; they drive many robots at a time."""
    found, errors = importlib.import_module(_EXPLORERS), importlib.import_module(_ERRORS)
    try:
        made = found.make_policy(name, 1, env.task, env.robot, env.world.has_heights)
    except errors.BaselineError as error:
        raise ValueError(str(error)) from error
    made.reset(np.arange(1), np.array([seed]))

    def act(observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        row: np.ndarray = made.act(observation[None], {key: np.array([value]) for key, value in info.items()})[0]
        return row

    return act
