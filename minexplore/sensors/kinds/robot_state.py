"""What a robot knows beside its sensors: its pose, its odometry, the map of what it has seen, and its goal."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from minexplore.sensing.odometry import WheelOdometry
from minexplore.sensors.kind import SensorKind
from minexplore.sensors.sensed_robot import SensedRobot

_FARTHEST_M, _GOAL_M = 100_000.0, 1000.0
_POSE = np.array([_FARTHEST_M] * 3 + [np.pi] * 3, np.float32)
_ODOMETRY = np.array([_FARTHEST_M] * 2 + [np.pi], np.float32)
_CELLS = 33  # of the map, in width and height
_GIVES = {
    "pose": "x, y, height (m, mine frame), yaw, pitch, roll (rad)",
    "odometry": "x, y (m), yaw (rad), counted from the wheels since the episode's first reading, which is true",
    "map": f"{_CELLS} x {_CELLS} cells of the task round the robot, the first row in the south: 1 where seen, else 0",
    "goal": "ahead, to the left and up, m, in a task with a goal",
}


class RobotState(SensorKind):
    """The readings `pose`, `odometry`, `map` and `goal`."""

    CHANGES = ("_odometry",)

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Return the names of the readings."""
        return tuple(_GIVES)

    @classmethod
    def space(cls, name: str) -> gymnasium.spaces.Box:
        """Return the space of a reading."""
        if name == "map":
            return gymnasium.spaces.Box(0, 1, (_CELLS, _CELLS), np.uint8)
        most = {"pose": _POSE, "odometry": _ODOMETRY, "goal": np.full(3, _GOAL_M, np.float32)}[name]
        return gymnasium.spaces.Box(-most, most, dtype=np.float32)

    @classmethod
    def gives(cls, name: str) -> str:
        """Return what `capture` gives."""
        return _GIVES[name]

    def __init__(self, robot: SensedRobot) -> None:
        """Take the robot."""
        super().__init__(robot)
        self._odometry: WheelOdometry | None = None

    def begin(self, rng: np.random.Generator) -> None:
        """Let the odometry begin anew where the robot is when it is first read."""
        self._odometry = None

    def read(self, name: str, rng: np.random.Generator) -> np.ndarray:
        """Return a reading: 6, 3 or 3 numbers, or the map (rows, columns) uint8.

        Raises
        ------
        ValueError
            If the robot has no wheels to count, or its task no goal.
        """
        batch, only = self.robot.robots, np.array([self.robot.row])
        if name == "pose":
            x, y, yaw = batch.poses(only)[0]
            return np.array([x, y, batch.heights(only)[0], yaw, *batch.attitudes(only)[0]])
        if name == "odometry":
            return self._counted(batch, only, rng)
        if name == "map":
            return _patch_of(batch, self.robot.row)
        if not hasattr(batch.rules, "towards"):
            raise ValueError("sensors: 'goal': the task has no goal; want an id MineXplore/GoTo-..., or goal={}")
        found: np.ndarray = batch.rules.towards(only)[0]
        return found

    def _counted(self, batch: Any, only: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return the pose that is counted from the wheels; a second reading in a step counts nothing."""
        if batch.robot.FLIES:
            raise ValueError("sensors: 'odometry': this robot has no wheels")
        pose, own = batch.poses(only), np.zeros(1, int)
        if self._odometry is None:
            self._odometry = WheelOdometry(1, batch.robot.between_sides_m)
            self._odometry.begin(0, rng)
            self._odometry.place(own, pose)
        zones = batch.world.zones_at(pose[:, 0])
        friction = np.array([zone.friction for zone in batch.world.active_zones(batch.task.terrain)])[zones]
        self._odometry.advance(own, pose, friction)
        return self._odometry.poses[0].copy()


def _patch_of(batch: Any, row: int) -> np.ndarray:
    """Return which cells round a robot it has seen, (rows, columns) uint8, its own cell in the middle."""
    grid, half = batch.grid, _CELLS // 2
    seen = np.pad(grid.in_plan(batch.seen[row]), half)
    x, y = batch.poses(np.array([row]))[0, :2]
    column, line = np.floor((np.array([x, y]) - grid.origin_m) / grid.cell_m).astype(int)
    found = np.zeros((_CELLS, _CELLS), np.uint8)
    part = seen[max(line, 0) : line + _CELLS, max(column, 0) : column + _CELLS]
    found[: part.shape[0], : part.shape[1]] = part
    return found
