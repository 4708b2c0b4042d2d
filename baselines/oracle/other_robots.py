"""The time networks of robots beside the default one, by how fast each can go: a husky's, and a quadrotor's."""

from __future__ import annotations

import dataclasses

import numpy as np

from baselines.base.errors import BaselineError
from baselines.oracle.network import TimeNetwork, time_network
from baselines.oracle.problem import CoverageProblem, SquareGrid
from baselines.oracle.spans import network_over_spans
from minexplore.envs.flyer_batch import FlyerBatch
from minexplore.envs.robot_batch import RobotBatch
from minexplore.physics.robot import RobotParams
from minexplore.physics.robot_kind import DrivenRobot
from minexplore.world import World

# How much faster a husky goes than its wheels make it, m/s, down the dip of 5 deg, beside `baselines.base.speed`: its
# tyres give and creep. It is at least what medians over 24 places were, 0.01, 0.05 and 0.31 m/s.
_CREEP_MPS = {"dry": 0.0, "mud": 0.03, "water": 0.3}
_ANY_ZONE_MPS = max(_CREEP_MPS.values())


def network_of(batch: RobotBatch, band_s: float) -> TimeNetwork:
    """Return the network of bands of any robot, see `time_network`.

    Raises
    ------
    BaselineError
        If the robot flies in a world that is one volume: no network holds its shafts.
    """
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


def network_in_air(batch: FlyerBatch, band_s: float) -> TimeNetwork:
    """Return the network of bands in plan of a robot that flies in a level mine, each with the cubes in view from it.

    A cube counts where its column is in view in plan: a beam through the cube crosses the column too. Floor zones slow
    no flyer. In a mine that dips its climb adds to its way in plan.

    Raises
    ------
    BaselineError
        If the world is one volume: a shaft is a way that no network in plan holds.
    """
    if batch.world.volume is not None:
        raise BaselineError(
            f"{batch.world.folder}: the bound of a robot that flies is for level mines; this is one volume"
        )
    task = dataclasses.replace(batch.task, terrain=False, max_forward_mps=_fastest_in_plan(batch))
    cubes = batch.grid
    grid = SquareGrid(cubes.in_plan(cubes.reachable), cubes.origin_m, cubes.cell_m)
    network = time_network(CoverageProblem(batch.world, task, batch.robot, grid), band_s)
    columns = cubes.columns()
    credit = {
        node: np.concatenate([columns[cell] for cell in cells.tolist()] or [np.zeros(0, dtype=int)])
        for node, cells in network.credit.items()
    }
    return dataclasses.replace(network, credit=credit)


def _fastest_in_plan(batch: FlyerBatch) -> float:
    """Return the fastest speed (m/s) along the mine's plane: ahead and level, and down or up at once, along its dip."""
    world: World = batch.world
    cos = float(world.T_world_mine[2, 2]) if batch.task.tilt else 1.0
    sin = float(np.sqrt(max(0.0, 1.0 - cos**2)))
    return batch.task.max_forward_mps * cos + batch.robot.climb_mps * sin
