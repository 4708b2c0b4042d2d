"""The oracle: drives a planned walk on the known map, by its true pose and its beams."""

from __future__ import annotations

import itertools
from typing import Any

import networkx as nx
import numpy as np
from skimage.graph import MCP_Geometric

from baselines.base.beams import beam_ranges
from baselines.base.errors import BaselineError
from baselines.explorers.pursuit import PathFollower
from baselines.oracle.bound import Walk
from baselines.oracle.network import TimeNetwork
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from minexplore.world import World

_NEAR_ROCK_M, _NEAR_ROCK_PENALTY = 1.5, 8.0  # paths cost up to 1 + 8 times their length nearer to rock than this
_WINDOW_CELLS = 60  # around two places, in which the path between them is planned
_SEARCH_POINTS = 60  # path points ahead of the last one passed among which the robot is located


def plan_tour(network: TimeNetwork, walk: Walk, world: World) -> np.ndarray:
    """Return a walk as a path (n, 2), m, from the spawn; between two nodes it keeps away from the walls.

    Raises
    ------
    BaselineError
        If the walk is empty or not connected.
    """
    passages: nx.MultiDiGraph = nx.MultiDiGraph(walk.passages)
    if not walk.passages or not nx.has_eulerian_path(passages, network.root):
        raise BaselineError("oracle: the solver found no connected walk; give it more time (--limit)")
    nodes = [network.root, *(v for _, v in nx.eulerian_path(passages, network.root))]
    nearness = np.clip((_NEAR_ROCK_M - world.clearance_m) / _NEAR_ROCK_M, 0, 1)
    cost = np.where(network.standing, 1.0 + _NEAR_ROCK_PENALTY * nearness**2, -1.0)
    path = [network.places[network.root][None]]
    for here, there in itertools.pairwise(nodes):
        start, end = (
            tuple(np.floor((network.places[p] - world.origin_m) / world.cell_m).astype(int)[::-1])
            for p in (here, there)
        )
        low = np.maximum(np.minimum(start, end) - _WINDOW_CELLS, 0)
        high = np.maximum(start, end) + _WINDOW_CELLS + 1
        tree = MCP_Geometric(cost[low[0] : high[0], low[1] : high[1]], fully_connected=True)
        tree.find_costs([tuple(start - low)], [tuple(end - low)])
        cells = np.array(tree.traceback(tuple(end - low))) + low
        path.append(world.origin_m + (cells[1:, ::-1] + 0.5) * world.cell_m)
    return np.concatenate(path)


class OracleTour:
    """Follows one path with all robots; at its end it stops and turns on the spot."""

    def __init__(self, count: int, task: TaskParams, robot: RobotParams, path: np.ndarray) -> None:
        """Take the path (n, 2), m."""
        self._task, self._path = task, path
        self._follower = PathFollower(task, robot)
        self._passed = np.zeros(count, dtype=int)

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Begin new episodes."""
        self._passed[robots] = 0

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        ranges = beam_ranges(observation, self._task)
        poses = info["pose_m_rad"]
        return np.array([self._drive(robot, poses[robot], ranges[robot]) for robot in range(len(ranges))])

    def _drive(self, robot: int, pose: np.ndarray, ranges: np.ndarray) -> tuple[float, float]:
        ahead = self._path[self._passed[robot] : self._passed[robot] + _SEARCH_POINTS]
        self._passed[robot] += int(np.linalg.norm(ahead - pose[:2], axis=1).argmin())
        rest = self._path[self._passed[robot] : self._passed[robot] + _SEARCH_POINTS]
        return (0.0, 0.5) if len(rest) < 3 else self._follower.follow(rest, pose, ranges)
