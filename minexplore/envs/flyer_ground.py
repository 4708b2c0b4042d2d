"""What robots that fly move over in a mine that is drawn in plan: starts above the floor, and cubes to see."""

from __future__ import annotations

import math

import numpy as np

from minexplore.envs.ground import PlanGround
from minexplore.physics.flyer_models import FlyerModels
from minexplore.physics.quadrotor import QuadrotorParams
from minexplore.physics.stepper import PhysicsStepper
from minexplore.rotations import quaternion, rotate_inverse
from minexplore.sensing.cubes import CubeGrid
from minexplore.task import TaskParams
from minexplore.world import World

_START_M = 1.2  # above the floor; half-way to a lower roof


class FlyerGround(PlanGround):
    """A level floor that is drawn in plan, under robots that do not touch it."""

    models: FlyerModels  # type: ignore[assignment]
    grid: CubeGrid  # type: ignore[assignment]

    def __init__(self, world: World, task: TaskParams, robot: QuadrotorParams, count: int, whole: bool) -> None:
        """Read the rock and find the cubes that the robot reaches.

        Raises
        ------
        ValueError
            If the world is one volume.
        """
        if world.volume is not None:
            raise ValueError(f"robot = quadrotor: {world.folder} is one volume, in which only the default robot drives")
        self.world, self.robot = world, robot  # type: ignore[assignment]
        self.models = FlyerModels(world, task, robot, whole)
        self.T_world_mine = self.models.T_world_mine
        anchor_m = np.array(world.record["spawn"]["anchor_m"])
        self.start_m = np.array([*anchor_m, _START_M])
        self.grid = CubeGrid(world, task.cell_m, robot.radius_m, robot.half_height_m, anchor_m, task.region_m)

    def pose(self, place_m: np.ndarray, yaw_rad: float) -> np.ndarray:
        """Return the pose of a robot that is level over a place (2,) m of the plan; see `RobotGround`."""
        x, y = place_m[:2]
        start = np.array([[x, y, min(_START_M, float(self.world.record["height_m"]) / 2)]])
        R, t = self.T_world_mine[:3, :3], self.T_world_mine[:3, 3]
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        ahead = rotate_inverse(np.array([[cos, sin, 0.0]]), R.T)[0]
        flat = ahead[:2] / math.sqrt(ahead[0] ** 2 + ahead[1] ** 2)
        turn = quaternion(np.array([[flat[0], -flat[1], 0], [flat[1], flat[0], 0], [0, 0, 1.0]]))
        return np.concatenate([rotate_inverse(start, R.T)[0] + t, turn])

    def prepare(self, stepper: PhysicsStepper, robots: np.ndarray, places_m: np.ndarray) -> np.ndarray:
        """Return the places, by which models are chosen in three dimensions."""
        return places_m
