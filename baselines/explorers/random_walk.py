"""Random commands: the lowest score that a policy should have."""

from __future__ import annotations

from typing import Any

import numpy as np

from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams

_HOLD_STEPS = 10  # control steps: one second


class RandomWalk:
    """Draws a uniform command every second and holds it."""

    def __init__(self, count: int, task: TaskParams, robot: RobotParams) -> None:
        """Prepare a generator for each of `count` robots."""
        self._rngs = [np.random.default_rng(i) for i in range(count)]
        self._held_steps = np.zeros(count, dtype=int)
        self._command = np.zeros((count, 2))

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Begin new episodes."""
        for robot, seed in zip(robots.tolist(), seeds.tolist(), strict=True):
            self._rngs[robot] = np.random.default_rng(seed)
        self._held_steps[robots] = 0

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        for robot in np.flatnonzero(self._held_steps == 0).tolist():
            self._command[robot] = self._rngs[robot].uniform(-1, 1, 2)
        self._held_steps = (self._held_steps + 1) % _HOLD_STEPS
        return self._command
