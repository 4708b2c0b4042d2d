"""The batch, the observations and the commands of each kind of robot."""

from __future__ import annotations

import gymnasium
import numpy as np

from minexplore.envs.flyer_batch import flyer_space
from minexplore.envs.robot_batch import RobotBatch
from minexplore.envs.sensed.degraded_batch import check_pose, driving_batch, flying_batch
from minexplore.physics.quadrotor import QuadrotorParams
from minexplore.physics.robot_kind import Robot
from minexplore.sensing.lidar import Backend
from minexplore.sensing.observation import observation_space
from minexplore.sensing.params import IDEAL, SensorParams
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
    pose: object = "true",
    conditions: SensorParams = IDEAL,
) -> RobotBatch:
    """Return the batch that drives robots of a kind, by a true or a counted pose, with clear or degraded beams.

    Raises
    ------
    ValueError
        If the pose is none, or a robot without wheels is to count them.
    """
    check_pose(pose)
    batch = (world, task, robot, count, threads, lidar, whole)
    if not isinstance(robot, QuadrotorParams):
        return driving_batch(pose, conditions, *batch)
    if pose != "true":
        raise ValueError(f"pose = {pose!r}: a quadrotor has no wheels; want true")
    return flying_batch(conditions, *batch)


def observations_of(task: TaskParams, robot: Robot) -> gymnasium.spaces.Box:
    """Return the space of one robot's observation."""
    return flyer_space(task, robot) if isinstance(robot, QuadrotorParams) else observation_space(task)


def commands_of(robot: Robot) -> gymnasium.spaces.Box:
    """Return the space of one robot's commands."""
    return gymnasium.spaces.Box(-1.0, 1.0, (robot.COMMANDS,), np.float32)
