"""Pure pursuit of a path: steer to a point ahead on it, slow down before obstacles, never drive into one."""

from __future__ import annotations

import numpy as np

from baselines.base.beams import beam_bearings
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams

_LOOKAHEAD_M = 1.4
_CUT_M = 0.25  # a chord to the place ahead may leave the path by so much: round a corner the lookahead is shorter
_AHEAD = 8  # places of the path that are looked at: enough for 1.4 m at a spacing of 0.2 m
_NEAR_M = 0.2  # beside the robot's disc: an obstacle nearer than this slows the robot
_FULL_SPEED_M = 1.6  # free distance ahead
_CREEP = 0.25  # of the full speed: beside an obstacle that the robot does not hit
_SIDE_M = 0.05  # beside the robot's disc: an obstacle nearer than this is hit
_STOP_M = 0.15  # between the robot's disc and what it would hit


class Steering:
    """Turns heading errors and ranges into commands, for any number of robots."""

    def __init__(self, task: TaskParams, robot: RobotParams) -> None:
        """Take the beams and the turn rate of the task and the radius of the robot."""
        self.bearings = beam_bearings(task)
        self._max_turn_radps = task.max_turn_radps
        self._near_m, self._wide_m = robot.radius_m + _NEAR_M, robot.radius_m + _SIDE_M
        self._sin, self._cos = np.sin(np.abs(self.bearings)), np.cos(self.bearings)
        self._ahead = np.abs(self.bearings) < np.pi / 3
        self._left = (self.bearings > 0) & (self.bearings < np.pi / 2)
        self._right = (self.bearings < 0) & (self.bearings > -np.pi / 2)

    def commands(self, error: np.ndarray, ranges: np.ndarray) -> np.ndarray:
        """Return the commands (k, 2), forward and turn in [-1, 1], of robots that want to turn to their paths.

        An obstacle near the robot's way slows it to a creep. One within the strip that its disc sweeps stops it: it
        reverses from what it faces, and turns on the spot to a path that leads elsewhere.

        Parameters
        ----------
        error : (k,) rad
            From the heading to the place that is steered to, in [-pi, pi].
        ranges : (k, beams) m
        """
        across, along = ranges * self._sin, ranges * self._cos
        free = np.where(self._ahead & (across < self._near_m), along, np.inf).min(axis=1)
        speed = np.clip((free - self._near_m) / (_FULL_SPEED_M - self._near_m), _CREEP, 1)
        reach = np.sqrt(np.maximum(self._wide_m**2 - across**2, 0))  # of the disc ahead, beside its middle
        gap = np.where((along > 0) & (across < self._wide_m), along - reach, np.inf).min(axis=1)
        touches, faces = gap < _STOP_M, np.abs(error) < np.pi / 4
        forward = np.where(touches, 0.0, speed) * np.clip(1.25 * np.cos(error), 0, 1)
        turn = np.clip(2.2 * error / self._max_turn_radps, -1, 1)
        to_left = ranges[:, self._left].mean(axis=1) > ranges[:, self._right].mean(axis=1)
        blocked = touches & faces  # by an obstacle that the map does not show
        forward, turn = np.where(blocked, -0.3, forward), np.where(blocked, np.where(to_left, 0.6, -0.6), turn)
        return np.column_stack([forward, turn])


class PathFollower:
    """Follows paths with one robot's beams, speed and radius."""

    def __init__(self, task: TaskParams, robot: RobotParams) -> None:
        """Take the beams and the turn rate of the task and the radius of the robot."""
        self._steering = Steering(task, robot)
        self.bearings = self._steering.bearings

    def follow(self, path: np.ndarray, pose: np.ndarray, ranges: np.ndarray) -> tuple[float, float]:
        """Return the command (forward, turn) in [-1, 1] that takes a robot along a path.

        Parameters
        ----------
        path : (n, 2) m
            From near the robot to its goal, 0.2 to 0.6 m from place to place.
        pose : (3,)
            x, y, m, and yaw, rad.
        ranges : (beams,) m
        """
        error = heading_errors(path[None], np.array([len(path)]), pose[None])
        forward, turn = self._steering.commands(error, ranges[None])[0].tolist()
        return forward, turn


def heading_errors(paths: np.ndarray, lengths: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Return the angles (k,) rad from robots' headings to the places of their paths that they steer to.

    A robot steers to the first place that is 1.4 m away or farther, counted from the place nearest to it, or to an
    earlier one where the straight way would leave the path by more than 0.25 m.

    Parameters
    ----------
    paths : (k, n, 2) m
        Paths, filled up at their ends.
    lengths : (k,) int
        Places of each path.
    poses : (k, 3)
        x, y, m, and yaw, rad.
    """
    robots, last, order = np.arange(len(poses))[:, None], np.maximum(lengths - 1, 0)[:, None], np.arange(_AHEAD + 1)
    apart = np.hypot(paths[..., 0] - poses[:, None, 0], paths[..., 1] - poses[:, None, 1])
    apart = np.where(np.arange(paths.shape[1]) <= last, apart, np.inf)
    index = np.minimum(apart.argmin(axis=1)[:, None] + order, last)
    ahead, away = paths[robots, index] - poses[:, None, :2], np.take_along_axis(apart, index, axis=1)
    along = ahead / np.maximum(away, 1e-9)[..., None]
    off = np.abs(along[:, :, None, 0] * ahead[:, None, :, 1] - along[:, :, None, 1] * ahead[:, None, :, 0])
    cut = np.where(order <= order[:, None], off, 0.0).max(axis=2)  # by the chord to each place
    reach = np.where((away > _LOOKAHEAD_M) & (order > 0), order, _AHEAD).min(axis=1)[:, None]
    allowed = (order <= reach) & ((cut <= _CUT_M) | (order <= 1))
    aim = _AHEAD - allowed[:, ::-1].argmax(axis=1)
    east, north = ahead[robots[:, 0], aim].T
    return (np.arctan2(north, east) - poses[:, 2] + np.pi) % (2 * np.pi) - np.pi
