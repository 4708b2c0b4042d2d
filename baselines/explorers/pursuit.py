"""Pure pursuit of a path: steer to a point ahead on it, slow down before obstacles, never drive into one."""

from __future__ import annotations

import math

import numpy as np

from baselines.beams import beam_bearings
from minexplore.robot import RobotParams
from minexplore.task import TaskParams

_LOOKAHEAD_M = 1.4
_MARGIN_M = 0.2  # beside and ahead of the robot's disc: an obstacle that is nearer stops the robot
_FULL_SPEED_M = 1.6  # free distance ahead


class PathFollower:
    """Follows paths with one robot's beams, speed and radius."""

    def __init__(self, task: TaskParams, robot: RobotParams) -> None:
        """Take the beams and the turn rate of the task and the radius of the robot."""
        self.bearings = beam_bearings(task)
        self._max_turn_radps = task.max_turn_radps
        self._clear_m = robot.radius_m + _MARGIN_M

    def follow(self, path: np.ndarray, pose: np.ndarray, ranges: np.ndarray) -> tuple[float, float]:
        """Return the command (forward, turn) in [-1, 1] that takes a robot along a path.

        Parameters
        ----------
        path : (n, 2) m
            From near the robot to its goal.
        pose : (3,)
            x, y, m, and yaw, rad.
        ranges : (beams,) m
        """
        error = self._heading_error(path, pose)
        turn = float(np.clip(2.2 * error / self._max_turn_radps, -1, 1))
        off_axis = np.abs(self.bearings)
        across, along = ranges * np.sin(off_axis), ranges * np.cos(off_axis)
        in_the_way = (off_axis < np.pi / 3) & (across < self._clear_m)
        free = float(along[in_the_way].min(initial=np.inf))
        if free < self._clear_m and abs(error) < np.pi / 4:  # an obstacle that the map does not show
            return self._back_off(ranges)
        speed = np.clip((free - self._clear_m) / (_FULL_SPEED_M - self._clear_m), 0, 1)
        return float(speed * np.clip(1.25 * np.cos(error), 0, 1)), turn

    def _heading_error(self, path: np.ndarray, pose: np.ndarray) -> float:
        """Return the angle, rad, from the robot's heading to the point of the path that it steers to."""
        distance = np.linalg.norm(path - pose[:2], axis=1)
        nearest = int(distance.argmin())
        beyond = np.flatnonzero(distance[nearest:] > _LOOKAHEAD_M)
        target = path[nearest + beyond[0]] if len(beyond) else path[-1]
        east, north = target - pose[:2]
        return (math.atan2(north, east) - pose[2] + math.pi) % (2 * math.pi) - math.pi

    def _back_off(self, ranges: np.ndarray) -> tuple[float, float]:
        """Return the command that reverses and turns to the side with more space."""
        left = ranges[(self.bearings > 0) & (self.bearings < np.pi / 2)].mean()
        right = ranges[(self.bearings < 0) & (self.bearings > -np.pi / 2)].mean()
        return -0.3, 0.6 if left > right else -0.6
