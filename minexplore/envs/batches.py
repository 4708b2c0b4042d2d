"""The batch, the observations and the commands of each kind of robot."""

from __future__ import annotations

import gymnasium
import numpy as np

from minexplore.envs.flyer_batch import FlyerBatch, flyer_space
from minexplore.envs.robot_batch import RobotBatch
from minexplore.physics.quadrotor import QuadrotorParams
from minexplore.physics.robot_kind import Robot
from minexplore.sensing.lidar import Backend
from minexplore.sensing.observation import observation_space
from minexplore.task import TaskParams
from minexplore.world import World


def make_batch(
    world: World,
    task: TaskParams,
    robot: Robot,
    count: int,
    threads: int = 1,
    lidar: Backend = "auto",
    whole: bool = False,
) -> RobotBatch:
    """Return the batch that drives robots of a kind; see `RobotBatch`."""
    if isinstance(robot, QuadrotorParams):
        return FlyerBatch(world, task, robot, count, threads, lidar, whole)
    return RobotBatch(world, task, robot, count, threads, lidar, whole)


def observations_of(task: TaskParams, robot: Robot) -> gymnasium.spaces.Box:
    """Return the space of one robot's observation."""
    return flyer_space(task, robot) if isinstance(robot, QuadrotorParams) else observation_space(task)


def commands_of(robot: Robot) -> gymnasium.spaces.Box:
    """Return the space of one robot's commands."""
    return gymnasium.spaces.Box(-1.0, 1.0, (robot.COMMANDS,), np.float32)
