"""Explorers that plan on a graph of their own map: one that drives to the nearest cluster is the base of all others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from baselines.base.beams import beam_ranges
from baselines.explorers.maps.map_graph import Cell, MapGraph, map_graph, worth_driving_to
from baselines.explorers.maps.own_map import OwnMap
from baselines.explorers.pursuit import PathFollower
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams

_REPLAN_STEPS = 15  # control steps between plans
_HYSTERESIS_M = 3.0  # a new goal must be this much better than the present one
_GIVE_UP_STEPS = 60  # control steps beside a frontier that stays unseen
_BESIDE_M = 3.0
STILL_M, _STILL_STEPS = 1.0, 80  # a goal is given up, too, while the robot stays so long within a metre of one place


@dataclass(frozen=True)
class Situation:
    """What an explorer decides by.

    Attributes
    ----------
    graph : MapGraph
        Of the robot's own map.
    robot : int
        The node where the robot is.
    goals : (k,) int
        The cheapest node of each cluster of the frontier that can be reached.
    sizes : (k,) int
        Cells of each cluster.
    costs : (k,) m
        From the robot to each goal; the present goal's cluster counts 3 m less.
    ages : (k,) int
        Control steps since the newest cell of each cluster came into the frontier.
    present : int
        Index of the present goal's cluster; -1 if that was seen, or cannot be reached.
    """

    graph: MapGraph
    robot: int
    goals: np.ndarray
    sizes: np.ndarray
    costs: np.ndarray
    ages: np.ndarray
    present: int


class GraphExplorer:
    """Drives to the cluster of the frontier that `choose` selects.

    The map is built from the beams and the true pose, and it is planned on as a graph.
    """

    commit_steps = 0  # control steps for which a goal is kept, whatever `choose` says, while it is a frontier

    def __init__(self, count: int, task: TaskParams, robot: RobotParams) -> None:
        """Start with empty maps."""
        self._task, self._robot = task, robot
        self._follower = PathFollower(task, robot)
        self._drivers = [_Driver(task, robot) for _ in range(count)]

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Empty the maps of robots (k,)."""
        for robot in robots.tolist():
            self._drivers[robot] = _Driver(self._task, self._robot)

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        ranges = beam_ranges(observation, self._task)
        return np.array([self._drive(*each) for each in zip(self._drivers, info["pose_m_rad"], ranges, strict=True)])

    def _drive(self, driver: _Driver, pose: np.ndarray, ranges: np.ndarray) -> tuple[float, float]:
        driver.map.add(pose[:2], pose[2] + self._follower.bearings, ranges, self._task.range_m[1])
        if driver.wants_a_plan(pose[:2]):
            situation = driver.look_around(pose[:2])
            driver.head_for(situation, None if situation is None else self._choose(driver, situation))
        if driver.path is None:
            return 0.0, 0.5  # no frontier is left: turn on the spot
        return self._follower.follow(driver.path, pose, ranges)

    def _choose(self, driver: _Driver, situation: Situation) -> int:
        if situation.present >= 0 and driver.steps_to_goal < self.commit_steps:
            return situation.present
        return self.choose(situation)

    def choose(self, situation: Situation) -> int:
        """Return the index of the cluster to drive to."""
        return int(situation.costs.argmin())


class _Driver:
    """One robot's map, goal and path."""

    def __init__(self, task: TaskParams, robot: RobotParams) -> None:
        self.map = OwnMap(task.cell_m)
        self.path: np.ndarray | None = None
        self.steps_to_goal = 0  # since the present goal's cluster was chosen
        self._radius_m, self._region_m = robot.radius_m, task.region_m
        self._start: np.ndarray | None = None
        self._goal: Cell | None = None
        self._step = self._planned = 0
        self._since: dict[Cell, int] = {}  # the step at which each cell of the frontier came into it
        self._beside: dict[Cell, int] = {}
        self._before = np.zeros(0)
        self._place = self._anchor = np.full(2, np.inf)  # of the robot at the last plan, and where it has stayed since
        self._anchored = 0

    def wants_a_plan(self, place: np.ndarray) -> bool:
        """Count a control step; return whether the plan is old, or its goal is seen or reached."""
        self._step += 1
        self._start = place if self._start is None else self._start
        if self.path is None or self._goal is None or self._step - self._planned >= _REPLAN_STEPS:
            return True
        col, row = np.array(self._goal) - self.map.low
        return bool(self.map.seen[row, col]) or bool(np.linalg.norm(self.path[-1] - place) < 0.5)

    def look_around(self, place: np.ndarray) -> Situation | None:
        """Return what there is to decide at a place (2,) m; None if no frontier can be reached."""
        self._place = place.copy()
        if not np.linalg.norm(place - self._anchor) <= STILL_M:
            self._anchor, self._anchored = place.copy(), self._step
        given_up = [cell for cell, steps in self._beside.items() if steps > _GIVE_UP_STEPS]
        keep = worth_driving_to(self.map, given_up, place if self._start is None else self._start, self._region_m)
        graph = map_graph(self.map, self._radius_m, keep)
        if not len(graph.cells):
            return None
        robot = graph.nearest(place)
        costs, self._before = (row[0] for row in graph.costs_from([robot]))
        cells = [(int(col), int(row)) for col, row in graph.cells[graph.cluster > 0]]
        self._since = {cell: self._since.get(cell, self._step) for cell in cells}
        goals, sizes, ages = [], [], []
        for number in np.unique(graph.cluster[(graph.cluster > 0) & np.isfinite(costs)]).tolist():
            members = np.flatnonzero(graph.cluster == number)
            goals.append(int(members[costs[members].argmin()]))
            sizes.append(len(members))
            ages.append(self._step - max(self._since[int(col), int(row)] for col, row in graph.cells[members]))
        if not goals:
            return None
        kept = [list(self._goal or ()) in graph.cells[graph.cluster == graph.cluster[g]].tolist() for g in goals]
        present = kept.index(True) if True in kept else -1
        near = costs[goals] - _HYSTERESIS_M * np.array(kept)
        return Situation(graph, robot, np.array(goals), np.array(sizes), near, np.array(ages), present)

    def head_for(self, situation: Situation | None, chosen: int | None) -> None:
        """Take the path to a cluster; without one there is no path."""
        passed, self._planned = self._step - self._planned, self._step
        if situation is None or chosen is None:
            self.path, self._goal = None, None
            return
        node = int(situation.goals[chosen])
        goal = (int(situation.graph.cells[node, 0]), int(situation.graph.cells[node, 1]))
        self.path = situation.graph.path(self._place, self._before, node)
        still = self._step - self._anchored > _STILL_STEPS
        if goal == self._goal and (still or situation.costs[chosen] < _BESIDE_M):
            self._beside[goal] = self._beside.get(goal, 0) + passed
        self.steps_to_goal = self.steps_to_goal + passed if chosen == situation.present else 0
        self._goal = goal
