"""The time network of a robot that flies in a level mine: as on wheels, but with cubes in view and its top speed."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from baselines.base.errors import BaselineError
from baselines.oracle.network import TimeNetwork, time_network
from minexplore.envs.flyer_batch import FlyerBatch


def network_in_volume(batch: FlyerBatch, band_s: float) -> TimeNetwork:
    """Return the network of bands in plan, each with the cubes in view from it.

    A cube counts where its column is in view in plan: a beam through the cube crosses the column too. Floor zones slow
    no flyer, and in a mine that dips its climb adds to its way in plan.

    Raises
    ------
    BaselineError
        If the mine has heights: a shaft is a way that no network in plan holds.
    """
    if batch.world.has_heights:
        raise BaselineError(
            f"{batch.world.folder}: the bound of a robot that flies is for level mines; this has heights"
        )
    fastest = math.hypot(batch.task.max_forward_mps, batch.robot.climb_mps)
    task = dataclasses.replace(batch.task, terrain=False, max_forward_mps=fastest)
    cubes = batch.grid
    seen = cubes.in_plan(cubes.reachable)
    grid = SimpleNamespace(reachable=seen, origin_m=cubes.origin_m, cell_m=cubes.cell_m, total=int(seen.sum()))
    plan = SimpleNamespace(world=batch.world, task=task, robot=batch.robot, grid=grid)
    network = time_network(cast(Any, plan), band_s)
    columns = cubes.columns()
    credit = {
        node: np.concatenate([columns[cell] for cell in cells.tolist()] or [np.zeros(0, dtype=int)])
        for node, cells in network.credit.items()
    }
    return dataclasses.replace(network, credit=credit)
