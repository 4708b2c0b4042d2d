"""What robots at poses of a mine see, without physics: the environment's own beams and its own coverage cells."""

from __future__ import annotations

import numpy as np

from baselines.base.beams import beam_bearings
from minexplore.physics.robot import RobotParams
from minexplore.sensing.coverage import CoverageGrid
from minexplore.sensing.lidar import shared_lidar
from minexplore.task import TaskParams
from minexplore.world import World


class Senses:
    """Beams and coverage of one mine, as `RobotBatch` has them for robots that stand still."""

    def __init__(self, world: World, task: TaskParams, robot: RobotParams) -> None:
        """Take a mine.

        Raises
        ------
        ValueError
            If the mine's floor is not flat, or the robot fits nowhere.
        """
        if world.has_heights:
            raise ValueError(f"{world.folder}: its floor is not flat, want a mine without heights")
        anchor_m = np.array(world.record["spawn"]["anchor_m"])
        self.lidar = shared_lidar(world.folder, world.record["world_sha256"], task.range_m[1], "auto")
        self.grid = CoverageGrid(world, task.cell_m, robot.radius_m, anchor_m, task.region_m)
        self.bearings, self._height_m, self._far_m = beam_bearings(task), robot.sensor_height_m, task.range_m[1]

    def cast(self, poses: np.ndarray) -> np.ndarray:
        """Return true ranges (n, beams), m, at poses (n, 3): x, y, m, and yaw, rad."""
        return self.lidar.cast(*self._rays(poses))

    def cells(self, poses: np.ndarray, ranges: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the number of the pose, row and column of every cell that a beam passes through."""
        origins, directions = self._rays(poses)
        ends = origins[:, None] + directions * ranges[..., None]
        starts = np.repeat(origins, ranges.shape[1], axis=0)
        ray, row, col = self.grid.cells_crossed(starts, ends.reshape(-1, 3), self._far_m)
        return ray // ranges.shape[1], row, col

    def _rays(self, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return origins (n, 3) m and unit directions (n, beams, 3)."""
        origins = np.column_stack([poses[:, :2], np.full(len(poses), self._height_m)])
        angles = poses[:, 2:] + self.bearings
        return origins, np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=-1)
