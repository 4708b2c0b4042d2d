"""Where robots are: in the plan, in the mine frame and against the level, by their integration states."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from minexplore.envs.ground import RobotGround
from minexplore.physics.robot_kind import Robot
from minexplore.rotations import rotate_inverse, rotation_matrices
from minexplore.world import World


class Stances(NamedTuple):
    """How k robots stand; read-only.

    Attributes
    ----------
    places_m : (k, 3) float64, m, mine frame
        Of their bodies, which are those of axles.
    level : (k, 3, 3) float64
        Their axes ahead, to the left and up as columns, world frame, whose z is up against gravity.
    axes : (k, 3, 3) float64
        The same axes as rows, mine frame.
    """

    places_m: np.ndarray
    level: np.ndarray
    axes: np.ndarray

    def poses(self) -> np.ndarray:
        """Return x, y (m) and yaw (rad) in the mine frame, (k, 3)."""
        found = np.empty((len(self.places_m), 3))
        found[:, :2] = self.places_m[:, :2]
        # NumPy's arc tangent differs between processors.
        found[:, 2] = [math.atan2(y, x) for x, y in self.axes[:, 0, :2].tolist()]
        return found


class RobotPlaces:
    """The places, headings and speeds of n robots of a batch."""

    world: World
    ground: RobotGround
    robot: Robot
    qpos: np.ndarray
    qvel: np.ndarray
    _R: np.ndarray
    _t: np.ndarray
    _every: np.ndarray  # the numbers of all robots
    _last: tuple[bytes, Stances] | None = None  # the poses that were last asked for, and how robots stand in them

    def _rows(self, robots: np.ndarray) -> slice | np.ndarray:
        """Return what picks the rows of robots (k,): of all robots a slice, which copies nothing."""
        return slice(None) if robots is self._every else robots

    def _stances(self, robots: np.ndarray) -> Stances:
        """Return how robots (k,) stand. A step asks several times between two moves, which costs no more than once."""
        pose = self.qpos[self._rows(robots), :7]
        key = pose.tobytes()
        if self._last is None or self._last[0] != key:
            level = rotation_matrices(pose[:, 3:])
            axes = rotate_inverse(level.transpose(0, 2, 1).reshape(-1, 3), self._R).reshape(level.shape)
            found = Stances(rotate_inverse(pose[:, :3] - self._t, self._R), level, axes)
            for array in found:
                array.setflags(write=False)
            self._last = key, found
        return self._last[1]

    def _mine_places(self, robots: np.ndarray) -> np.ndarray:
        """Return the places (k, 3) m of robots' bodies, which are those of axles, in the mine frame; read-only."""
        return self._stances(robots).places_m

    def poses(self, robots: np.ndarray | None = None) -> np.ndarray:
        """Return x, y (m) and yaw (rad) in the mine frame, (k, 3), of robots (k,), of all by default."""
        return self._stances(self._every if robots is None else robots).poses()

    def heights(self, robots: np.ndarray) -> np.ndarray:
        """Return how high the floor is under robots (k,) m, by the height of their axles in the mine frame."""
        return self._heights_of(self._stances(robots))

    def _heights_of(self, now: Stances) -> np.ndarray:
        return now.places_m[:, 2] - self.robot.wheel_radius_m

    def attitudes(self, robots: np.ndarray) -> np.ndarray:
        """Return pitch, nose up, and roll, left side up, (k, 2) rad, of robots against the level."""
        return self._attitudes_of(self._stances(robots))

    def _attitudes_of(self, now: Stances) -> np.ndarray:
        return np.arcsin(now.level[:, 2, :2].clip(-1.0, 1.0))

    def _speeds(self, robots: np.ndarray) -> np.ndarray:
        along = rotate_inverse(self.qvel[self._rows(robots), :3], self._R)
        return np.hypot(along[:, 0], along[:, 1])
