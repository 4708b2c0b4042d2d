"""The oracle: drives a planned walk on the known map, by its true pose and its beams."""

from __future__ import annotations

import itertools
from typing import Any

import networkx as nx
import numpy as np
from skimage.graph import MCP_Geometric

from baselines import pursuit
from baselines.errors import BaselineError
from baselines.oracle.bound import Walk
from baselines.oracle.network import TimeNetwork
from baselines.policy import ranges_m
from minexplore.task import TaskParams
from minexplore.world import World

_SOFT_M = 1.5  # from rock: the nearer the dearer
_LOOK = 60  # path points ahead of the last one passed among which the robot is looked for


def plan_tour(network: TimeNetwork, walk: Walk, world: World) -> np.ndarray:
    """Return a walk as a path (n, 2), m, from the spawn: each passage by the way that keeps off the walls.

    Raises
    ------
    BaselineError
        If the walk does not hang together.
    """
    passages: nx.MultiDiGraph = nx.MultiDiGraph(walk.passages)
    if not walk.passages or not nx.has_eulerian_path(passages, network.root):
        raise BaselineError("oracle: no walk to drive")
    nodes = [network.root, *(v for _, v in nx.eulerian_path(passages, network.root))]
    off = np.clip((_SOFT_M - world.clearance_m) / _SOFT_M, 0, 1)
    cost = np.where(network.standing, 1.0 + 8.0 * off**2, -1.0)
    path = [network.places[network.root][None]]
    for here, there in itertools.pairwise(nodes):
        start, end = (
            tuple(np.floor((network.places[p] - world.origin_m) / world.cell_m).astype(int)[::-1])
            for p in (here, there)
        )
        low = np.maximum(np.minimum(start, end) - 60, 0)
        high = np.maximum(start, end) + 61
        ways = MCP_Geometric(cost[low[0] : high[0], low[1] : high[1]], fully_connected=True)
        ways.find_costs([tuple(start - low)], [tuple(end - low)])
        cells = np.array(ways.traceback(tuple(end - low))) + low
        path.append(world.origin_m + (cells[1:, ::-1] + 0.5) * world.cell_m)
    return np.concatenate(path)


class OracleTour:
    """Follows one path for all robots; where the path ends, stands and looks round."""

    builds_on = (pursuit,)

    def __init__(self, robots: int, task: TaskParams, path: np.ndarray) -> None:
        """Take the path (n, 2), m."""
        self._task, self._path = task, path
        bearings = 2 * np.pi * np.arange(task.beams) / task.beams
        self._bearings = (bearings + np.pi) % (2 * np.pi) - np.pi
        self._passed = np.zeros(robots, dtype=int)

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Begin new episodes."""
        self._passed[robots] = 0

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        commands = []
        for robot, (pose, ranges) in enumerate(zip(info["pose_m_rad"], ranges_m(observation, self._task), strict=True)):
            ahead = self._path[self._passed[robot] : self._passed[robot] + _LOOK]
            self._passed[robot] += int(np.linalg.norm(ahead - pose[:2], axis=1).argmin())
            rest = self._path[self._passed[robot] : self._passed[robot] + _LOOK]
            if len(rest) < 3:
                commands.append((0.0, 0.5))
            else:
                commands.append(pursuit.follow(rest, pose, self._bearings, ranges, self._task.max_turn_radps))
        return np.array(commands)
