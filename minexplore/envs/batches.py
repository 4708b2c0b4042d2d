"""The batch, the observations and the commands of each kind of robot."""

from __future__ import annotations

import gymnasium
import numpy as np

from minexplore.envs.call_checks import check_pose
from minexplore.envs.robot_batch import RobotBatch
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
    if robot.FLIES:
        if pose != "true":
            raise ValueError(f"pose = {pose!r}: a quadrotor has no wheels; want true")
        from minexplore.envs.sensed.degraded_batch import flying_batch

        return flying_batch(conditions, *batch)
    if pose == "true" and conditions.is_ideal:
        return RobotBatch(*batch)
    from minexplore.envs.sensed.degraded_batch import driving_batch

    return driving_batch(pose, conditions, *batch)


def observations_of(task: TaskParams, robot: Robot) -> gymnasium.spaces.Box:
    """Return the space of one robot's observation."""
    if not robot.FLIES:
        return observation_space(task)

    from minexplore.envs.flyer_batch import flyer_space

    return flyer_space(task, robot)


def commands_of(robot: Robot) -> gymnasium.spaces.Box:
    """Return the space of one robot's commands."""
    return gymnasium.spaces.Box(-1.0, 1.0, (robot.COMMANDS,), np.float32)
