"""Frontier assignment: a team of robots shares one map, and each drives to a cluster of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from baselines.base.beams import beam_bearings
from baselines.explorers.ground import GoalCell, new_ground, stances_in
from baselines.explorers.maps.map_graph import MapGraph
from baselines.explorers.pursuit import PathFollower
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams

_REPLAN_STEPS = 15  # control steps between plans
_UNREACHABLE_M = 1e6
_MATE_M = 0.8  # a beam that ends this near to a robot of the team has hit it, and not rock
_GIVE_UP_STEPS = 100  # control steps beside a cell of the frontier that stays unseen
_BESIDE_M = 3.0
_FAR_M = 30.0  # a frontier so far away is farther than most that a doubt opens


@dataclass(frozen=True)
class TeamWays:
    """TeamWays from n robots to k clusters of the frontier.

    Attributes
    ----------
    graphs : (n,)
        The graph as each robot plans on it, or None.
    nodes : (n, k) int
        Each cluster's nearest node.
    lengths : (n, k) m
        To these nodes, 1e6 where no way leads.
    before : (n,) of arrays
        The node before each node on the way, see `MapGraph.costs_from`.
    """

    graphs: list[MapGraph | None]
    nodes: np.ndarray
    lengths: np.ndarray
    before: list[np.ndarray]


class AssignedFrontiers:
    """Clusters of the frontier go to robots so that the sum of path lengths is least (as Burgard et al. 2005 compare).

    All robots map together, by the beams and the true poses of all, in layers in a mine with heights. A robot without a
    cluster shares its nearest one.
    """

    def __init__(self, count: int, task: TaskParams, robot: RobotParams, heights: bool = False) -> None:
        """Start with an empty map."""
        self._task, self._robot, self._heights = task, robot, heights
        self._bearings, self._follower = beam_bearings(task), PathFollower(task, robot)
        self._count = count
        self.reset()

    def reset(self) -> None:
        """Begin a new episode."""
        self.ground = new_ground(self._task, self._robot, self._heights, self._count)
        self._paths: list[np.ndarray | None] = [None] * self._count
        self._beside: dict[GoalCell, int] = {}
        self._start = np.zeros(2)
        self._step = 0

    def act(self, ranges: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2) in [-1, 1].

        Parameters
        ----------
        ranges : (n, beams) m
        info : dict
            `pose_m_rad` (n, 3); in a mine with heights `height_m`, `pitch_rad` and `roll_rad` (n,) as well.
        """
        poses = info["pose_m_rad"]
        for robot, stance in enumerate(stances_in(info, self._heights)):
            free = self._without_mates(robot, poses, ranges[robot])
            self.ground.add(stance, self._bearings[free], ranges[robot][free], self._task.range_m[1], robot)
        if self._step == 0:
            self._start = poses[0, :2]
        if self._step % _REPLAN_STEPS == 0:
            self._plan(poses)
        self._step += 1
        commands = np.zeros((self._count, 2))
        for robot, path in enumerate(self._paths):
            commands[robot] = (0.0, 0.5) if path is None else self._follower.follow(path, poses[robot], ranges[robot])
        return commands

    def _without_mates(self, robot: int, poses: np.ndarray, ranges: np.ndarray) -> np.ndarray:
        """Return which beams (beams,) of a robot end at rock, or at nothing."""
        bearing = poses[robot, 2] + self._bearings
        ends = poses[robot, :2] + ranges[:, None] * np.column_stack([np.cos(bearing), np.sin(bearing)])
        mates = np.delete(poses[:, :2], robot, axis=0)
        return (np.linalg.norm(ends[:, None] - mates, axis=2) > _MATE_M).all(axis=1)

    def _plan(self, poses: np.ndarray) -> None:
        """Assign clusters to robots and take the paths to them; where none is near, doubt rock that may be a floor."""
        ways = self._ways(poses)
        for doubt in self.ground.doubts():
            if ways.lengths.min(axis=1, initial=_UNREACHABLE_M).max() > _FAR_M and doubt():
                self._beside.clear()
                ways = self._ways(poses)
        self._paths = [None] * self._count
        if not ways.lengths.size:
            return
        chosen = ways.lengths.argmin(axis=1)
        robots, clusters = linear_sum_assignment(ways.lengths)
        chosen[robots] = np.where(ways.lengths[robots, clusters] < _UNREACHABLE_M, clusters, chosen[robots])
        for robot, cluster in enumerate(chosen.tolist()):
            graph, length_m, node = ways.graphs[robot], ways.lengths[robot, cluster], int(ways.nodes[robot, cluster])
            if graph is not None and length_m < _UNREACHABLE_M:
                self._paths[robot] = graph.path(poses[robot, :2], ways.before[robot], node)
                self._count_steps_beside(graph, node, length_m)

    def _ways(self, poses: np.ndarray) -> TeamWays:
        """Return the ways of all robots to all clusters."""
        given_up = [cell for cell, steps in self._beside.items() if steps > _GIVE_UP_STEPS]
        graphs = self.ground.graphs(given_up, self._start, self._task.region_m)
        graph = next((each for each in graphs if each is not None), None)
        members = [] if graph is None else [np.flatnonzero(graph.cluster == k) for k in np.unique(graph.cluster) if k]
        nodes, lengths = np.zeros((2, self._count, len(members)))
        lengths[:] = _UNREACHABLE_M
        before = [np.zeros(0)] * self._count
        for robot, own in enumerate(graphs if members else []):
            if own is not None:
                costs, before[robot] = (row[0] for row in own.costs_from([own.nearest(poses[robot, :2])]))
                nodes[robot] = [cells[costs[cells].argmin()] for cells in members]
                lengths[robot] = np.minimum([costs[cells].min() for cells in members], _UNREACHABLE_M)
        return TeamWays(graphs, nodes.astype(int), lengths, before)

    def _count_steps_beside(self, graph: MapGraph, node: int, length_m: float) -> None:
        if length_m < _BESIDE_M:
            cell = tuple(graph.cells[node].tolist())
            self._beside[cell] = self._beside.get(cell, 0) + _REPLAN_STEPS
