"""The batch, the observations and the commands of each kind of robot."""

from __future__ import annotations

from typing import Any

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
    goal: Any = None,
    together: bool = False,
) -> RobotBatch:
    """Return the batch that drives robots of a kind, by a true or a counted pose, with clear or degraded beams.

    The robots are each alone in its own copy of the mine, or `together` in one.

    Raises
    ------
    ValueError
        If the pose is none, a robot without wheels is to count them, or the `goal` is none for this world and robot.
    """
    check_pose(pose)
    kind: type[RobotBatch] = RobotBatch
    if robot.FLIES or pose != "true" or not conditions.is_ideal:
        from minexplore.envs.sensed.degraded_batch import kind_of_batch

        kind = kind_of_batch(robot, pose, conditions)
    if together:
        from minexplore.envs.team import team_of

        kind = team_of(kind)
    beams: dict[str, Any] = {} if conditions.is_ideal else {"conditions": conditions}
    robots = kind(world, task, robot, count, threads, lidar, whole, **beams)
    if goal is not None:
        from minexplore.tasks.goto import GoTo

        robots.rules = GoTo(robots, goal)
    return robots


def observations_of(
    task: TaskParams, robot: Robot, goal: Any = None, has_heights: bool = False
) -> gymnasium.spaces.Box:
    """Return the space of one robot's observation, in a world with or without heights where the task has a `goal`."""
    own = observation_space(task)
    if robot.FLIES:
        from minexplore.envs.flyer_batch import flyer_space

        own = flyer_space(task, robot)
    if goal is None:
        return own
    from minexplore.tasks.goto import goal_space

    return goal_space(own, has_heights)


def commands_of(robot: Robot) -> gymnasium.spaces.Box:
    """Return the space of one robot's commands."""
    return gymnasium.spaces.Box(-1.0, 1.0, (robot.COMMANDS,), np.float32)
