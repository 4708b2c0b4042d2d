"""The least a policy can do: random commands, each held for a while."""

from __future__ import annotations

from typing import Any

import numpy as np

from minexplore.task import TaskParams

_HELD = 10  # control steps: one second


class RandomWalk:
    """Uniform commands, drawn anew every second."""

    def __init__(self, robots: int, task: TaskParams) -> None:
        """Take the number of robots."""
        self._rngs = [np.random.default_rng(i) for i in range(robots)]
        self._held = np.zeros(robots, dtype=int)
        self._command = np.zeros((robots, 2))

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Begin new episodes."""
        for robot, seed in zip(robots.tolist(), seeds.tolist(), strict=True):
            self._rngs[robot] = np.random.default_rng(seed)
        self._held[robots] = 0

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        for robot in np.flatnonzero(self._held == 0).tolist():
            self._command[robot] = self._rngs[robot].uniform(-1, 1, 2)
        self._held = (self._held + 1) % _HELD
        return self._command
