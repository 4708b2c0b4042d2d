"""What robots that fly move over in a level mine: starts above the floor, and cubes to see."""

from __future__ import annotations

import numpy as np

from minexplore.envs.ground import PlanGround
from minexplore.physics.flyer_models import FlyerModels
from minexplore.physics.quadrotor import START_M, QuadrotorParams, level_pose
from minexplore.physics.stepper import PhysicsStepper
from minexplore.sensing.cubes import CubeGrid, level_middles
from minexplore.task import TaskParams
from minexplore.world import World


class FlyerGround(PlanGround):
    """A level floor that is drawn in plan, under robots that do not touch it."""

    models: FlyerModels  # type: ignore[assignment]
    grid: CubeGrid  # type: ignore[assignment]

    def __init__(self, world: World, task: TaskParams, robot: QuadrotorParams, count: int, whole: bool) -> None:
        """Read the rock and find the cubes that the robot reaches.

        Raises
        ------
        ValueError
            If the robot fits nowhere.
        """
        self.world, self.robot = world, robot  # type: ignore[assignment]
        self.models = FlyerModels(world, task, robot, whole)
        self.T_world_mine = self.models.T_world_mine
        anchor_m = np.array(world.record["spawn"]["anchor_m"])
        self.start_m = np.append(anchor_m, START_M)
        middles = level_middles(world, robot.radius_m, robot.half_height_m, anchor_m, task.region_m)
        try:
            self.grid = CubeGrid(middles, task.cell_m)
        except ValueError as error:
            raise ValueError(f"{world.folder}: {error}") from error

    def pose(self, place_m: np.ndarray, yaw_rad: float) -> np.ndarray:
        """Return the pose of a robot that is level over a place (2,) m of the plan; see `RobotGround`."""
        height_m = min(START_M, float(self.world.record["height_m"]) / 2)
        return level_pose(self.T_world_mine, np.array([*place_m[:2], height_m]), yaw_rad)

    def prepare(self, stepper: PhysicsStepper, robots: np.ndarray, places_m: np.ndarray) -> np.ndarray:
        """Return the places, by which models are chosen in three dimensions."""
        return places_m
