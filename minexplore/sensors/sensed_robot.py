"""What sensors know of the robot that carries them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from minexplore.rotations import rotate_inverse, rotation_matrices

if TYPE_CHECKING:
    from collections.abc import Callable

    from minexplore.pictures.render import Renderer
    from minexplore.sensing.lidar import Backend
    from minexplore.sensing.mount import Pose3D
    from minexplore.sensing.params import SensorParams


class SensedRobot:
    """The robot of a batch's `row`, as its sensors know it.

    `velocity_mps` and `before_mps` (3,), world frame, are its velocities at the end of this control step and before it.
    """

    def __init__(self, robots: Any, drawing: Callable[[], Renderer], params: SensorParams, backend: Backend) -> None:
        """Take a `RobotBatch`, what draws its world, and how its sensors degrade and cast rays."""
        self.robots, self.drawing, self.params, self.backend, self.row = robots, drawing, params, backend, 0
        self.before_mps = self.velocity_mps = np.zeros(3)

    @property
    def step_s(self) -> float:
        """Return the time between two readings."""
        return float(self.robots.task.control_s)

    @property
    def axes(self) -> np.ndarray:
        """Return the robot's axes (3, 3), in columns, in the world frame, whose z is up against gravity."""
        found: np.ndarray = rotation_matrices(self.robots.qpos[self.row, None, 3:7])[0]
        return found

    def pose(self) -> Pose3D:
        """Return the robot's pose in the mine frame, its origin on the floor or at a guard's lower edge."""
        from minexplore.sensing.mount import Pose3D

        turn, shift = self.robots.T_world_mine[:3, :3], self.robots.T_world_mine[:3, 3]
        axes = rotate_inverse(self.axes.T, turn).T
        place = rotate_inverse(self.robots.qpos[self.row, None, :3] - shift, turn)[0]
        return Pose3D(place - self.robots.robot.origin_height_m * axes[:, 2], axes)

    def world_pose(self) -> Pose3D:
        """Return the same pose in the world frame, in which MuJoCo draws."""
        from minexplore.sensing.mount import Pose3D

        axes = self.axes
        return Pose3D(self.robots.qpos[self.row, :3] - self.robots.robot.origin_height_m * axes[:, 2], axes)
