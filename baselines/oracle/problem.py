"""What limits how much a robot can see in a mine: the input of every network of driving times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from minexplore.envs.robot_batch import RobotBatch
from minexplore.physics.robot_kind import Robot
from minexplore.sensing.coverage import CellGrid
from minexplore.task import TaskParams
from minexplore.world import World


@dataclass(frozen=True)
class SquareGrid:
    """Squares of the plan to see: `reachable` (rows, cols) from `origin_m` (2,) m on, mine frame, `cell_m` wide."""

    reachable: np.ndarray
    origin_m: np.ndarray
    cell_m: float


@dataclass(frozen=True)
class CoverageProblem:
    """A mine, the task's speeds and ranges in it, a robot, and the cells that it is to see."""

    world: World
    task: TaskParams
    robot: Robot
    grid: CellGrid | SquareGrid

    @classmethod
    def of(cls, batch: RobotBatch) -> CoverageProblem:
        """Return the problem of each robot of a batch."""
        return cls(batch.world, batch.task, batch.robot, batch.grid)
