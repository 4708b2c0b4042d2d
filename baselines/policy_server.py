"""A policy that is called with plain bytes."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.policy import make_policy, policy_sha256
from minexplore.robot import RobotParams
from minexplore.task import TaskParams, coerce_params


class PolicyServer:
    """Makes a policy for `count` robots and answers its calls."""

    def __init__(self, name: str, count: int, task: dict[str, Any], robot: dict[str, Any]) -> None:
        """Make the policy by its name, for a task and a robot given by their fields."""
        self._count = count
        self._policy = make_policy(name, count, coerce_params(TaskParams, task), coerce_params(RobotParams, robot))
        self.sha256 = policy_sha256(self._policy)

    def reset(self, seeds: list[int]) -> bytes:
        """Begin an episode of each robot."""
        self._policy.reset(np.arange(self._count), np.array(seeds))
        return b""

    def act(self, payload: bytes) -> bytes:
        """Return commands (n, 2) float64 for poses (n, 3) float64 and observations (n, features) float32."""
        poses = np.frombuffer(payload, np.float64, 3 * self._count).reshape(self._count, 3).copy()
        seen = np.frombuffer(payload, np.float32, offset=poses.nbytes).reshape(self._count, -1).copy()
        action = np.asarray(self._policy.act(seen, {"pose_m_rad": poses}), dtype=np.float64)
        if action.shape != (self._count, 2):
            raise ValueError(f"commands of shape {action.shape}: want ({self._count}, 2)")
        return action.tobytes()
