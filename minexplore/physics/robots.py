"""The robots that environments drive, by name."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from minexplore.physics.robot import RobotParams
from minexplore.physics.robot_kind import Robot
from minexplore.task import coerce_params

ROBOTS = {"husky": ("husky", "HuskyParams"), "quadrotor": ("quadrotor", "QuadrotorParams")}  # module here, and class
RobotChoice = str | Robot | dict[str, Any] | None  # what an environment takes as `robot`


def find_robot(robot: RobotChoice) -> Robot:
    """Return a robot given by its name, as parameters, or as a dict of fields of the default robot's.

    Raises
    ------
    ValueError
        If it is none of these.
    """
    if isinstance(robot, str):
        if robot not in ROBOTS:
            raise ValueError(f"robot = {robot!r}: want {', '.join(ROBOTS)}, RobotParams(...) or a dict of its fields")
        module, kind = ROBOTS[robot]
        found: Robot = getattr(import_module(f"minexplore.physics.{module}"), kind)()
        return found
    if isinstance(robot, Robot):
        return robot
    return coerce_params(RobotParams, robot)
