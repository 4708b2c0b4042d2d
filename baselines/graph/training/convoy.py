"""The path follower of the classical explorers for several robots at once."""

from __future__ import annotations

import numpy as np

from baselines.explorers.pursuit import Steering, heading_errors
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams

_FAR_M = 1e6


class Convoy:
    """Returns for each robot what `PathFollower.follow` returns for one."""

    def __init__(self, task: TaskParams, robot: RobotParams, count: int) -> None:
        """Start without paths."""
        self._steering = Steering(task, robot)
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
        error = heading_errors(paths, lengths, poses)
        idle = (lengths == 0)[:, None]
        return np.where(idle, [0.0, 0.5], self._steering.commands(error, ranges))
