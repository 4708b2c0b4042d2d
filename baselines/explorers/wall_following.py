"""Wall following: keep the right rib at a constant distance. Around a single pillar it returns to its start."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.base.beams import beam_bearings, beam_ranges
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams

_RIB_DISTANCE_M = 1.2
_LOST_M = 2.6  # a rib farther away than this has turned a corner, which the robot follows
_CORNER_STEPS = 35  # control steps of half a turn: without a rib by then, the robot drives ahead
_STOP_M, _FULL_SPEED_M = 0.9, 2.5  # range ahead at which the robot turns on the spot, and drives at full speed


class WallFollowing:
    """Keeps a rib 1.2 m to its right, turns left before obstacles, and drives around corners."""

    def __init__(self, count: int, task: TaskParams, robot: RobotParams) -> None:
        """Select the beams ahead, to the right, and between them."""
        self._task = task
        bearings = beam_bearings(task)
        self._ahead = np.abs(bearings) < np.radians(30)
        self._right = np.abs(bearings + np.pi / 2) < np.radians(30)
        self._between = (bearings < -np.radians(30)) & (bearings > -np.radians(60))
        self._steps_without_rib = np.full(count, _CORNER_STEPS)

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Begin new episodes."""
        self._steps_without_rib[robots] = _CORNER_STEPS

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        ranges = beam_ranges(observation, self._task)
        ahead = ranges[:, self._ahead].min(axis=1)
        right = ranges[:, self._right].min(axis=1)
        between = ranges[:, self._between].min(axis=1) * np.sin(np.pi / 4)  # its distance to the right
        rib = np.minimum(right, between)
        self._steps_without_rib = np.where(rib > _LOST_M, self._steps_without_rib + 1, 0)
        cornering = (self._steps_without_rib > 0) & (self._steps_without_rib < _CORNER_STEPS)
        steering = np.clip(0.8 * (_RIB_DISTANCE_M - rib), -0.5, 0.5)
        turn = np.where(self._steps_without_rib == 0, steering, np.where(cornering, -0.6, 0.0))
        forward = np.clip((ahead - _STOP_M) / (_FULL_SPEED_M - _STOP_M), 0.0, 1.0)
        forward = np.where(cornering, np.minimum(forward, 0.5), forward)
        blocked = ahead < _FULL_SPEED_M * 0.6
        turn = np.where(blocked, np.maximum(turn, 0.2 + 0.8 * (1 - forward)), turn)
        return np.column_stack([forward, turn])
