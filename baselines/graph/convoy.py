"""The path follower of the classical explorers for several robots at once."""

from __future__ import annotations

import numpy as np

from baselines.beams import beam_bearings
from baselines.explorers.pursuit import _FULL_SPEED_M, _LOOKAHEAD_M, _MARGIN_M
from minexplore.robot import RobotParams
from minexplore.task import TaskParams

_FAR_M = 1e6


class Convoy:
    """Returns for each robot what `PathFollower.follow` returns for one."""

    def __init__(self, task: TaskParams, robot: RobotParams, count: int) -> None:
        """Start without paths."""
        self._max_turn_radps, self._clear_m = task.max_turn_radps, robot.radius_m + _MARGIN_M
        bearings = beam_bearings(task)
        self._sin, self._cos = np.sin(np.abs(bearings)), np.cos(bearings)
        self._ahead = np.abs(bearings) < np.pi / 3
        self._left = (bearings > 0) & (bearings < np.pi / 2)
        self._right = (bearings < 0) & (bearings > -np.pi / 2)
        self._paths = np.full((count, 1, 2), _FAR_M)
        self._lengths = np.zeros(count, dtype=int)

    def take(self, robot: int, path: np.ndarray | None) -> None:
        """Give a robot a path (k, 2) m, or none."""
        count = 0 if path is None else len(path)
        if count > self._paths.shape[1]:
            wider = np.full((len(self._paths), count + 16, 2), _FAR_M)
            wider[:, : self._paths.shape[1]] = self._paths
            self._paths = wider
        self._lengths[robot] = count
        self._paths[robot] = _FAR_M
        if path is not None:
            self._paths[robot, :count] = path

    def follow(self, robots: np.ndarray, poses: np.ndarray, ranges: np.ndarray) -> np.ndarray:
        """Return commands (k, 2) of robots (k,) at poses (k, 3) with ranges (k, beams) m; without a path they turn."""
        longest = max(int(self._lengths[robots].max()), 1)
        paths, lengths = self._paths[robots, :longest], self._lengths[robots]
        apart = np.hypot(paths[..., 0] - poses[:, None, 0], paths[..., 1] - poses[:, None, 1])
        order, real = np.arange(longest), np.arange(longest) < lengths[:, None]
        nearest = apart.argmin(axis=1)
        beyond = real & (order >= nearest[:, None]) & (apart > _LOOKAHEAD_M)
        aim = np.where(beyond.any(axis=1), beyond.argmax(axis=1), np.maximum(lengths - 1, 0))
        east, north = (paths[np.arange(len(robots)), aim] - poses[:, :2]).T
        error = (np.arctan2(north, east) - poses[:, 2] + np.pi) % (2 * np.pi) - np.pi
        in_the_way = self._ahead & (ranges * self._sin < self._clear_m)
        free = np.where(in_the_way, ranges * self._cos, np.inf).min(axis=1)
        speed = np.clip((free - self._clear_m) / (_FULL_SPEED_M - self._clear_m), 0, 1)
        forward = speed * np.clip(1.25 * np.cos(error), 0, 1)
        turn = np.clip(2.2 * error / self._max_turn_radps, -1, 1)
        blocked = (free < self._clear_m) & (np.abs(error) < np.pi / 4)  # by an obstacle that the map does not show
        to_left = ranges[:, self._left].mean(axis=1) > ranges[:, self._right].mean(axis=1)
        forward, turn = np.where(blocked, -0.3, forward), np.where(blocked, np.where(to_left, 0.6, -0.6), turn)
        idle = lengths == 0
        return np.column_stack([np.where(idle, 0.0, forward), np.where(idle, 0.5, turn)])
