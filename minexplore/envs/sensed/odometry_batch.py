"""Robots that know their pose by their wheels only."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from minexplore.envs.robot_batch import RobotBatch
from minexplore.sensing.odometry import WheelOdometry
from minexplore.tasks.exploration import StepOutcome
from minexplore.tasks.starts import EpisodeStart, source_of


class OdometryBatch(RobotBatch):
    """As `RobotBatch`, but infos hold the counted pose as `pose_m_rad`, and the true one as `true_pose_m_rad`.

    Physics, observations and rewards are those of `RobotBatch` with the same seeds and actions.
    """

    def __init__(self, *arguments: Any, **named: Any) -> None:
        """Take the arguments of `RobotBatch`."""
        super().__init__(*arguments, **named)
        self._odometry = WheelOdometry(self.count, self.robot.between_sides_m)
        self._placed = np.zeros(self.count, dtype=bool)  # whether the odometry goes on from where the robot is
        self._friction = np.array([zone.friction for zone in self.world.active_zones(self.task.terrain)])

    def reset(
        self, robots: np.ndarray, rngs: list[np.random.Generator], start: EpisodeStart | None = None
    ) -> StepOutcome:
        """Place robots, and let them know where they begin."""
        for robot in robots.tolist():
            self._odometry.begin(robot, source_of(rngs[robot], robot, start))
        self._placed[robots] = False
        return super().reset(robots, rngs, start)

    def drive(self, command: np.ndarray, rngs: list[np.random.Generator], robots: np.ndarray) -> np.ndarray:
        """Advance robots, and count their motion on the floor that they began the step on."""
        friction = self._friction[self.world.zones_at(self._mine_places(robots)[:, 0])]
        collision = super().drive(command, rngs, robots)
        self._odometry.advance(robots, self.poses()[robots], friction)
        return collision

    def _info(self, robots: np.ndarray, collision: np.ndarray) -> dict[str, np.ndarray]:
        info = super()._info(robots, collision)
        fresh = ~self._placed[robots]
        if fresh.any():
            new = robots[fresh]
            self._odometry.place(new, info["pose_m_rad"][fresh])
            self._placed[new] = True
        return {**info, "pose_m_rad": self._odometry.poses[robots].copy(), "true_pose_m_rad": info["pose_m_rad"]}

    def copy_state(self) -> dict[str, Any]:
        """Return a copy of all that changes, the odometry too."""
        return {**super().copy_state(), "odometry": copy.deepcopy(self._odometry), "placed": self._placed.copy()}

    def restore_state(self, state: dict[str, Any]) -> None:
        """Take what `copy_state` returned."""
        super().restore_state(state)
        self._odometry, self._placed = copy.deepcopy(state["odometry"]), state["placed"].copy()
