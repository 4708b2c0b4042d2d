"""Follow the right rib: in a mine with one pillar it comes back to where it began, having seen one side of all."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.policy import ranges_m
from minexplore.task import TaskParams

_OFF_M = 1.2  # from the rib
_LOST_M = 2.6  # farther than that the rib has turned away: follow it round
_STOP_M, _FREE_M = 0.9, 2.5  # ahead: turn on the spot; drive at full speed


class WallFollowing:
    """Keeps the right rib at 1.2 m: turns left before what is ahead, right where the rib turns away."""

    def __init__(self, robots: int, task: TaskParams) -> None:
        """Find the beams ahead, to the right, and between."""
        self._task = task
        bearing = (np.arange(task.beams) / task.beams * 2 * np.pi + np.pi) % (2 * np.pi) - np.pi
        self._ahead = np.abs(bearing) < np.radians(30)
        self._right = np.abs(bearing + np.pi / 2) < np.radians(30)
        self._between = (bearing < -np.radians(30)) & (bearing > -np.radians(60))

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Begin new episodes: there is nothing to forget."""

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        ranges = ranges_m(observation, self._task)
        ahead = ranges[:, self._ahead].min(axis=1)
        right = ranges[:, self._right].min(axis=1)
        between = ranges[:, self._between].min(axis=1) * np.sin(np.pi / 4)  # its distance off to the right
        off = np.minimum(right, between)
        turn = np.clip(0.8 * (_OFF_M - off), -0.5, 0.5)
        turn = np.where(off > _LOST_M, -0.6, turn)
        forward = np.clip((ahead - _STOP_M) / (_FREE_M - _STOP_M), 0.0, 1.0)
        forward = np.where(off > _LOST_M, np.minimum(forward, 0.5), forward)
        blocked = ahead < _FREE_M * 0.6
        turn = np.where(blocked, np.maximum(turn, 0.2 + 0.8 * (1 - forward)), turn)
        return np.column_stack([forward, turn])
