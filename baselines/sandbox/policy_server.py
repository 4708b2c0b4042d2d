"""A policy that is called with plain bytes."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.policies.policy_lookup import make_policy
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams, coerce_params

HEIGHTS = (
    "height_m",
    "pitch_rad",
    "roll_rad",
)  # what a policy gets of a robot beside its pose in a mine with heights


class PolicyServer:
    """Makes a policy for `count` robots and answers its calls."""

    def __init__(
        self, name: str, count: int, task: dict[str, Any], robot: dict[str, Any], heights: bool = False
    ) -> None:
        """Make the policy by its name, for a task and a robot given by their fields."""
        self._count, self._keys = count, HEIGHTS if heights else ()
        params = coerce_params(TaskParams, task), coerce_params(RobotParams, robot)
        self._policy = make_policy(name, count, *params, heights)

    def reset(self, seeds: list[int]) -> bytes:
        """Begin an episode of each robot."""
        self._policy.reset(np.arange(self._count), np.array(seeds))
        return b""

    def act(self, payload: bytes) -> bytes:
        """Return commands (n, 2) float64.

        The payload is poses (n, 3) and, in a mine with heights, heights, pitches and rolls (n,), all float64; then
        observations (n, features) float32.
        """
        numbers = np.frombuffer(payload, np.float64, (3 + len(self._keys)) * self._count).copy()
        poses, *others = np.split(numbers, [(3 + k) * self._count for k in range(len(self._keys))])
        info = {"pose_m_rad": poses.reshape(self._count, 3), **dict(zip(self._keys, others, strict=True))}
        seen = np.frombuffer(payload, np.float32, offset=numbers.nbytes).reshape(self._count, -1).copy()
        action = np.asarray(self._policy.act(seen, info), dtype=np.float64)
        if action.shape != (self._count, 2):
            raise ValueError(f"commands of shape {action.shape}: want ({self._count}, 2)")
        return action.tobytes()
