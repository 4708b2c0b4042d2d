"""Many robots that fly, each alone in its own copy of one mine: beams all round, and cubes of the volume to see."""

from __future__ import annotations

import gymnasium
import numpy as np

from minexplore.envs.ground import PlanGround
from minexplore.envs.robot_batch import RobotBatch
from minexplore.envs.robot_places import Stances
from minexplore.physics.flyer_models import FlyerModels
from minexplore.physics.quadrotor import START_M, QuadrotorParams, level_pose
from minexplore.physics.robot_kind import Robot
from minexplore.physics.stepper import PhysicsStepper
from minexplore.sensing.cubes import CubeGrid, level_middles
from minexplore.sensing.lidar import Backend
from minexplore.task import TaskParams
from minexplore.volume.flying import AirGround
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


_INNER_S = 0.01  # of the controller: a twelfth of its fastest loop's time


class FlyerBatch(RobotBatch):
    """The state of n robots that fly, and their episodes.

    Commands are speeds ahead, to the left (both level, together at most the task's speed) and up, and a turn rate.
    Whatever touches the guard counts as a collision, the floor too. Floor zones have no effect.
    """

    robot: QuadrotorParams
    grid: CubeGrid  # type: ignore[assignment]

    def __init__(
        self,
        world: World,
        task: TaskParams,
        robot: QuadrotorParams,
        count: int,
        threads: int = 1,
        lidar: Backend = "auto",
        whole: bool = False,
    ) -> None:
        """Take a world; `whole` steps every robot in the model of all rock, for comparison."""
        super().__init__(world, task, robot, count, threads, lidar, whole)
        self._beams = robot.beams(task.beams)
        inner = max(1, round(_INNER_S / task.physics_s))
        self._bursts = [min(inner, task.substeps - at) for at in range(0, task.substeps, inner)]
        self._wanted = np.zeros((count, 4))

    def _make_ground(self, whole: bool) -> FlyerGround | AirGround:  # type: ignore[override]
        kind = FlyerGround if self.world.volume is None else AirGround
        return kind(self.world, self.task, self.robot, self.count, whole)

    def drive(self, command: np.ndarray, rngs: list[np.random.Generator], robots: np.ndarray) -> np.ndarray:
        """Advance robots (k,) by one control step without casting beams; return which touched anything (k,) bool."""
        task, wanted = self.task, command.copy()
        level = np.sqrt(wanted[:, 0] ** 2 + wanted[:, 1] ** 2)
        wanted[:, :2] *= (task.max_forward_mps / np.maximum(level, 1.0))[:, None]
        wanted[:, 2] *= self.robot.climb_mps
        wanted[:, 3] *= task.max_turn_radps
        touched = np.zeros(len(robots), dtype=bool)
        for steps in self._bursts:
            state = self.qpos[robots, 3:7], self.qvel[robots, :3], self.qvel[robots, 3:6]
            self.stepper.ctrl[robots] = self.robot.thrusts(*state, wanted)
            touched |= self.stepper.advance(robots, self._mine_places(robots), steps)
        return touched

    def _heights_of(self, now: Stances) -> np.ndarray:
        """Return how high robots (k,) are, m, mine frame."""
        return now.places_m[:, 2].copy()

    def _attitudes_of(self, now: Stances) -> np.ndarray:
        """Return pitch, nose up, and roll, left side up, (k, 2) rad, of robots in the mine frame."""
        return np.arcsin(np.clip(now.axes[:, :2, 2], -1.0, 1.0))

    def _speeds(self, robots: np.ndarray) -> np.ndarray:
        v = self.qvel[robots, :3]
        return np.sqrt(v[:, 0] ** 2 + v[:, 1] ** 2 + v[:, 2] ** 2)

    def _asked_speeds(self, command: np.ndarray) -> np.ndarray:
        level = np.minimum(np.sqrt(command[:, 0] ** 2 + command[:, 1] ** 2), 1.0) * self.task.max_forward_mps
        return np.asarray(np.sqrt(level**2 + (self.robot.climb_mps * command[:, 2]) ** 2))

    def _cast(self, robots: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the beams' origins (k, 3) m, directions (k, beams, 3) and true ranges (k, beams) m, mine frame."""
        now = self._stances(robots)
        origin, axes = now.places_m, now.axes[:, :, None]
        ahead, left, up = axes[:, 0], axes[:, 1], axes[:, 2]
        directions = self._beams[:, :1] * ahead + self._beams[:, 1:2] * left + self._beams[:, 2:] * up
        return origin, directions, self.lidar.cast(origin, directions)

    def _observe(self, robots: np.ndarray, ranges: np.ndarray, rngs: list[np.random.Generator]) -> np.ndarray:
        near, far = self.task.range_m
        noise = np.stack([rngs[robot].standard_normal(len(self._beams)) for robot in robots.tolist()])
        noisy = np.clip(ranges, near, far) + self.task.range_noise_m * noise
        scaled = np.clip((noisy - near) / (far - near), 0.0, 1.0)
        return np.hstack([scaled, self.previous[robots]]).astype(np.float32)


def flyer_space(task: TaskParams, robot: Robot) -> gymnasium.spaces.Box:
    """Return the space of one robot's observation, (beams + 4,) float32: ranges, then the previous command."""
    assert isinstance(robot, QuadrotorParams)
    beams = len(robot.beams(task.beams))
    low = np.array([0.0] * beams + [-1.0] * robot.COMMANDS, dtype=np.float32)
    return gymnasium.spaces.Box(low, np.ones_like(low), dtype=np.float32)
