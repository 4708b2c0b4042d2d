"""What robots of a batch drive on: the one interface that a level floor and a volume both have."""

from __future__ import annotations

from typing import Any, Protocol

import mujoco
import numpy as np

from minexplore.physics.local_models import LocalModels
from minexplore.physics.robot import free_joint_qpos
from minexplore.physics.robot_kind import Robot
from minexplore.physics.stepper import PhysicsStepper
from minexplore.sensing.coverage import CellGrid, CoverageGrid
from minexplore.task import TaskParams
from minexplore.world import World


class RobotGround(Protocol):
    """What robots of a batch drive on. Places are of the mine frame; (k, 3) m are those of their axles."""

    models: Any
    T_world_mine: np.ndarray

    @property
    def grid(self) -> CellGrid:
        """Return the cells that count."""

    @property
    def start_m(self) -> np.ndarray:
        """Return the place, as `models.tiles_of` takes it, whose model robots have before they are placed."""

    def places(self, clearance_m: float) -> np.ndarray:
        """Return the places (n, 2 or 3) m that have a clearance."""

    def pose(self, place_m: np.ndarray, yaw_rad: float) -> np.ndarray:
        """Return the free joint's place and quaternion (7,), world frame, of a robot that stands at such a place."""

    def brake(self, robots: np.ndarray, places_m: np.ndarray, qvel: np.ndarray) -> None:
        """Slow the robots (k,) that fall; `qvel` has a row for each of all robots."""

    def prepare(self, stepper: PhysicsStepper, robots: np.ndarray, places_m: np.ndarray) -> np.ndarray:
        """Prepare a control step of robots (k,); return the places (k, 2) that `PhysicsStepper.advance` takes."""

    def prepare_team(
        self, model: mujoco.MjModel, names: tuple[str, ...], places_m: np.ndarray, quat: np.ndarray
    ) -> None:
        """Prepare a control step of robots (n,) that are in one model."""

    def info(self, robots: np.ndarray, places_m: np.ndarray) -> dict[str, np.ndarray]:
        """Return what the info also says of robots (k,)."""


class PlanGround:
    """A level floor that is drawn in plan."""

    def __init__(self, world: World, task: TaskParams, robot: Robot, count: int, whole: bool) -> None:
        """Read the rock and find the cells that the robot reaches."""
        self.world, self.robot = world, robot
        self.models = LocalModels(world, task, robot, whole)
        self.T_world_mine = self.models.T_world_mine
        self.start_m = np.array(world.record["spawn"]["anchor_m"])
        self.grid = CoverageGrid(world, task.cell_m, robot.radius_m, self.start_m, task.region_m)

    def places(self, clearance_m: float) -> np.ndarray:
        """Return the places (n, 2) m, plan, that have a clearance; see `RobotGround`."""
        return self.world.places_m(clearance_m)

    def pose(self, place_m: np.ndarray, yaw_rad: float) -> np.ndarray:
        """Return the pose of a robot at a place (2,) m of the plan; see `RobotGround`."""
        x, y = place_m[:2]
        pose = free_joint_qpos(self.T_world_mine, self.robot, x, y, yaw_rad)
        pose[:3] += self.models.highest_m(place_m[:2], self.robot.radius_m) * self.T_world_mine[:3, 2]
        return pose

    def brake(self, robots: np.ndarray, places_m: np.ndarray, qvel: np.ndarray) -> None:
        """Do nothing: no robot falls on a level floor."""

    def prepare(self, stepper: PhysicsStepper, robots: np.ndarray, places_m: np.ndarray) -> np.ndarray:
        """Return the places in the plan; see `RobotGround`."""
        return places_m[:, :2]

    def prepare_team(
        self, model: mujoco.MjModel, names: tuple[str, ...], places_m: np.ndarray, quat: np.ndarray
    ) -> None:
        """Do nothing: floor zones have geoms of their own."""

    def info(self, robots: np.ndarray, places_m: np.ndarray) -> dict[str, np.ndarray]:
        """Return nothing more."""
        return {}


def ground_of(world: World, task: TaskParams, robot: Robot, count: int, whole: bool) -> RobotGround:
    """Return what so many robots on wheels drive on in a world."""
    if world.volume is None:
        return PlanGround(world, task, robot, count, whole)
    from minexplore.volume.ground import VolumeGround

    return VolumeGround(world, task, robot, count, whole)
