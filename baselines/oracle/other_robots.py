"""The time network of any robot, and how fast a husky can go."""

from __future__ import annotations

import dataclasses

from baselines.oracle.air import network_in_air
from baselines.oracle.network import TimeNetwork, time_network
from baselines.oracle.problem import CoverageProblem
from baselines.oracle.spans import network_over_spans
from minexplore.envs.flyer_batch import FlyerBatch
from minexplore.envs.robot_batch import RobotBatch
from minexplore.physics.robot import RobotParams
from minexplore.physics.robot_kind import DrivenRobot

# How much faster a husky goes than its wheels make it, m/s, down the dip of 5 deg, beside `baselines.base.speed`: its
# tyres give and creep. It is at least what medians over 24 places were, 0.01, 0.05 and 0.31 m/s.
_CREEP_MPS = {"dry": 0.0, "mud": 0.03, "water": 0.3}
_ANY_ZONE_MPS = max(_CREEP_MPS.values())


def network_of(batch: RobotBatch, band_s: float) -> TimeNetwork:
    """Return the network of bands of any robot, see `time_network`."""
    if isinstance(batch, FlyerBatch):
        return network_in_air(batch, band_s)
    build = time_network if batch.world.volume is None else network_over_spans
    problem = CoverageProblem.of(batch)
    return build(problem if isinstance(batch.robot, RobotParams) else _at_own_speed(problem), band_s)


def _at_own_speed(problem: CoverageProblem) -> CoverageProblem:
    """Return a problem with the speeds of its robot in place of those that are commanded."""
    world, task, robot = problem.world, problem.task, problem.robot
    assert isinstance(robot, DrivenRobot)
    zones = []
    for zone, own in zip(world.floor_zones, world.active_zones(task.terrain), strict=True):
        creep_mps = _CREEP_MPS.get(zone.name, _ANY_ZONE_MPS) if task.tilt or world.volume is not None else 0.0
        wheels_mps = robot.top_speed_mps(task.max_forward_mps * own.command_scale)
        zones.append(dataclasses.replace(zone, command_scale=wheels_mps + creep_mps))
    return dataclasses.replace(
        problem,
        world=dataclasses.replace(world, floor_zones=zones),
        task=dataclasses.replace(task, max_forward_mps=1.0, terrain=True),
    )
