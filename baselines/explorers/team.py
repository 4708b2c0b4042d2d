"""Frontier assignment: a team of robots shares one map, and each drives to a cluster of its own."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from baselines.base.beams import beam_bearings
from baselines.explorers.maps.map_graph import Cell, MapGraph, map_graph, worth_driving_to
from baselines.explorers.maps.own_map import OwnMap
from baselines.explorers.pursuit import PathFollower
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams

_REPLAN_STEPS = 15  # control steps between plans
_UNREACHABLE_M = 1e6
_MATE_M = 0.8  # a beam that ends this near to a robot of the team has hit it, and not rock
_GIVE_UP_STEPS = 100  # control steps beside a cell of the frontier that stays unseen
_BESIDE_M = 3.0


class AssignedFrontiers:
    """Clusters of the frontier go to robots so that the sum of path lengths is least (as Burgard et al. 2005 compare).

    All robots map together, by the beams and the true poses of all. A robot without a cluster shares its nearest one.
    """

    def __init__(self, count: int, task: TaskParams, robot: RobotParams) -> None:
        """Start with an empty map."""
        self._task, self._robot = task, robot
        self._bearings, self._follower = beam_bearings(task), PathFollower(task, robot)
        self._count = count
        self.reset()

    def reset(self) -> None:
        """Begin a new episode."""
        self.map = OwnMap(self._task.cell_m)
        self._paths: list[np.ndarray | None] = [None] * self._count
        self._beside: dict[Cell, int] = {}
        self._start = np.zeros(2)
        self._step = 0

    def act(self, ranges: np.ndarray, poses: np.ndarray) -> np.ndarray:
        """Return commands (n, 2) in [-1, 1].

        Parameters
        ----------
        ranges : (n, beams) m
        poses : (n, 3)
            x, y, m, and yaw, rad, in the mine frame.
        """
        for robot, pose in enumerate(poses):
            free = self._without_mates(robot, poses, ranges[robot])
            self.map.add(pose[:2], pose[2] + self._bearings[free], ranges[robot][free], self._task.range_m[1])
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
        """Assign clusters to robots and take the paths to them."""
        given_up = [cell for cell, steps in self._beside.items() if steps > _GIVE_UP_STEPS]
        keep = worth_driving_to(self.map, given_up, self._start, self._task.region_m)
        graph = map_graph(self.map, self._robot.radius_m, keep)
        numbers = np.unique(graph.cluster[graph.cluster > 0])
        self._paths = [None] * self._count
        if not len(numbers):
            return
        costs, before = graph.costs_from([graph.nearest(pose[:2]) for pose in poses])
        goals = [np.flatnonzero(graph.cluster == number) for number in numbers]
        nearest = np.array([[members[row[members].argmin()] for members in goals] for row in costs])  # (n, clusters)
        lengths = np.minimum(np.take_along_axis(costs, nearest, axis=1), _UNREACHABLE_M)
        chosen = lengths.argmin(axis=1)
        robots, clusters = linear_sum_assignment(lengths)
        chosen[robots] = np.where(lengths[robots, clusters] < _UNREACHABLE_M, clusters, chosen[robots])
        for robot, cluster in enumerate(chosen.tolist()):
            if lengths[robot, cluster] < _UNREACHABLE_M:
                node = int(nearest[robot, cluster])
                self._paths[robot] = graph.path(poses[robot, :2], before[robot], node)
                self._count_steps_beside(graph, node, lengths[robot, cluster])

    def _count_steps_beside(self, graph: MapGraph, node: int, length_m: float) -> None:
        if length_m < _BESIDE_M:
            cell = (int(graph.cells[node, 0]), int(graph.cells[node, 1]))
            self._beside[cell] = self._beside.get(cell, 0) + _REPLAN_STEPS
