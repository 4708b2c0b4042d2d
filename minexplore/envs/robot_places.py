"""Where robots are: in the plan, in the mine frame and against the level, by their integration states."""

from __future__ import annotations

import math

import numpy as np

from minexplore.envs.ground import RobotGround
from minexplore.physics.robot_kind import Robot
from minexplore.rotations import rotate_inverse, rotation_matrices
from minexplore.world import World


class RobotPlaces:
    """The places, headings and speeds of n robots of a batch."""

    world: World
    ground: RobotGround
    robot: Robot
    qpos: np.ndarray
    qvel: np.ndarray
    _R: np.ndarray
    _t: np.ndarray

    def _mine_places(self, robots: np.ndarray) -> np.ndarray:
        """Return the places (k, 3) m of robots' bodies, which are those of axles, in the mine frame."""
        return rotate_inverse(self.qpos[robots, :3] - self._t, self._R)

    def zones_under(self, robots: np.ndarray) -> np.ndarray:
        """Return the numbers (k,) of the floor zones that robots are in, by their eastings in the mine frame."""
        return self.world.zones_at(self._mine_places(robots)[:, 0])

    def poses(self) -> np.ndarray:
        """Return every robot's x, y (m) and yaw (rad) in the mine frame, (n, 3)."""
        place = rotate_inverse(self.qpos[:, :3] - self._t, self._R)
        heading = rotate_inverse(rotation_matrices(self.qpos[:, 3:7])[:, :, 0], self._R)
        yaw = [math.atan2(y, x) for x, y in heading[:, :2].tolist()]  # NumPy's differs between processors
        return np.column_stack([place[:, :2], yaw])

    def heights(self, robots: np.ndarray) -> np.ndarray:
        """Return how high the floor is under robots (k,) m, by the height of their axles in the mine frame."""
        return self._mine_places(robots)[:, 2] - self.robot.wheel_radius_m

    def attitudes(self, robots: np.ndarray) -> np.ndarray:
        """Return pitch, nose up, and roll, left side up, (k, 2) rad, of robots against the level."""
        axes = rotation_matrices(self.qpos[robots, 3:7])
        return np.arcsin(np.clip(axes[:, 2, :2], -1.0, 1.0))

    def _speeds(self, robots: np.ndarray) -> np.ndarray:
        along = rotate_inverse(self.qvel[robots, :3], self._R)
        return np.hypot(along[:, 0], along[:, 1])
