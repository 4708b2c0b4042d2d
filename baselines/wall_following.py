"""Follow the right rib: round a mine with one pillar it comes back to where it began, having seen one side of all."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.policy import ranges_m
from minexplore.task import TaskParams

_OFF_M = 1.2  # from the rib
_LOST_M = 2.6  # farther than that the rib has turned away: follow it round
_ROUND = 35  # control steps, half a turn: if there is no rib by then, there is none to go round
_STOP_M, _FREE_M = 0.9, 2.5  # ahead: turn on the spot; drive at full speed


class WallFollowing:
    """Keeps a rib 1.2 m to its right, turns left before what is ahead, and goes round corners."""

    def __init__(self, robots: int, task: TaskParams) -> None:
        """Find the beams ahead, to the right, and between."""
        self._task = task
        bearing = (np.arange(task.beams) / task.beams * 2 * np.pi + np.pi) % (2 * np.pi) - np.pi
        self._ahead = np.abs(bearing) < np.radians(30)
        self._right = np.abs(bearing + np.pi / 2) < np.radians(30)
        self._between = (bearing < -np.radians(30)) & (bearing > -np.radians(60))
        self._lost = np.full(robots, _ROUND)  # control steps since there was a rib

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Begin new episodes."""
        self._lost[robots] = _ROUND

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        ranges = ranges_m(observation, self._task)
        ahead = ranges[:, self._ahead].min(axis=1)
        right = ranges[:, self._right].min(axis=1)
        between = ranges[:, self._between].min(axis=1) * np.sin(np.pi / 4)  # its distance off to the right
        off = np.minimum(right, between)
        self._lost = np.where(off > _LOST_M, self._lost + 1, 0)
        rounding = (self._lost > 0) & (self._lost < _ROUND)
        turn = np.where(self._lost == 0, np.clip(0.8 * (_OFF_M - off), -0.5, 0.5), np.where(rounding, -0.6, 0.0))
        forward = np.clip((ahead - _STOP_M) / (_FREE_M - _STOP_M), 0.0, 1.0)
        forward = np.where(rounding, np.minimum(forward, 0.5), forward)
        blocked = ahead < _FREE_M * 0.6
        turn = np.where(blocked, np.maximum(turn, 0.2 + 0.8 * (1 - forward)), turn)
        return np.column_stack([forward, turn])
