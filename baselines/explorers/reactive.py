"""The heuristic of the paper's authors: drive ahead, slow down before obstacles, turn to the side with more space."""

from __future__ import annotations

from typing import Any

import numpy as np

from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams

_CLEAR_RANGE, _SLOW_COMMAND, _TURN_GAIN = 0.5, 0.3, 0.5  # the range is the scaled one of the observation


class Reactive:
    """Drives at full speed while the beams ahead are clear, else at 30 %; turns by the left ranges minus the right.

    This is what its authors describe. It has no memory and cannot leave a wall that it has driven into.
    """

    def __init__(self, count: int, task: TaskParams, robot: RobotParams) -> None:
        """Select the beams ahead and at the sides."""
        quarter = task.beams // 4
        self._ahead = [0, 1, task.beams - 1]
        self._left, self._right = [quarter, quarter + 1], [3 * quarter, 3 * quarter + 1]

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Begin new episodes; this policy has no state."""

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        forward = np.where(observation[:, self._ahead].min(axis=1) > _CLEAR_RANGE, 1.0, _SLOW_COMMAND)
        turn = _TURN_GAIN * (observation[:, self._left].sum(axis=1) - observation[:, self._right].sum(axis=1))
        return np.column_stack([forward, turn])
