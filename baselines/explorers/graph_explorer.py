"""Explorers that plan on a graph of their own map: one that drives to the nearest cluster is the base of all others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from baselines.base.beams import beam_ranges
from baselines.explorers.ground import GoalCell, Ground, new_ground, stances_in
from baselines.explorers.maps.map_graph import MapGraph
from baselines.explorers.pursuit import PathFollower
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams

_REPLAN_STEPS = 15  # control steps between plans
HYSTERESIS_M = 3.0  # a new goal must be this much better than the present one
GIVE_UP_STEPS = 60  # control steps beside a frontier that stays unseen
BESIDE_M = 3.0
STILL_M, STILL_STEPS = 1.0, 80  # a goal is given up, too, while the robot stays so long within a metre of one place
_FAR_M = 30.0  # a frontier so far away is farther than most that a doubt opens


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

    The map is built from the beams and the true pose, in layers in a mine with heights, and planned on as a graph.
    """

    commit_steps = 0  # control steps for which a goal is kept, whatever `choose` says, while it is a frontier

    def __init__(self, count: int, task: TaskParams, robot: RobotParams, heights: bool = False) -> None:
        """Start with empty maps."""
        self._task, self._robot, self._heights = task, robot, heights
        self._follower = PathFollower(task, robot)
        self._drivers = [self._new_driver() for _ in range(count)]

    def _new_driver(self) -> Driver:
        return Driver(new_ground(self._task, self._robot, self._heights), self._task.region_m)

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Empty the maps of robots (k,)."""
        for robot in robots.tolist():
            self._drivers[robot] = self._new_driver()

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        poses, ranges = info["pose_m_rad"], beam_ranges(observation, self._task)
        stances = stances_in(info, self._heights)
        return np.array([self._drive(*each) for each in zip(self._drivers, stances, poses, ranges, strict=True)])

    def _drive(self, driver: Driver, stance: Any, pose: np.ndarray, ranges: np.ndarray) -> tuple[float, float]:
        driver.ground.add(stance, self._follower.bearings, ranges, self._task.range_m[1])
        if driver.wants_a_plan(pose[:2]):
            situation = driver.look_around(pose[:2])
            driver.head_for(situation, None if situation is None else self._choose(driver, situation))
        if driver.path is None:
            return 0.0, 0.5  # no frontier is left: turn on the spot
        return self._follower.follow(driver.path, pose, ranges)

    def _choose(self, driver: Driver, situation: Situation) -> int:
        if situation.present >= 0 and driver.steps_to_goal < self.commit_steps:
            return situation.present
        return self.choose(situation)

    def choose(self, situation: Situation) -> int:
        """Return the index of the cluster to drive to."""
        return int(situation.costs.argmin())


class Driver:
    """One robot's ground, goal and path."""

    def __init__(self, ground: Ground, region_m: float) -> None:
        """Start without a goal; frontiers count within `region_m` of the robot's first place."""
        self.ground = ground
        self.path: np.ndarray | None = None
        self.goal: GoalCell | None = None
        self.steps_to_goal = 0  # since the present goal's cluster was chosen
        self._region_m = region_m
        self._start: np.ndarray | None = None
        self._step = self._planned = 0
        self._since: dict[GoalCell, int] = {}  # the step at which each cell of the frontier came into it
        self._beside: dict[GoalCell, int] = {}
        self._before = np.zeros(0)
        self._place = self._anchor = np.full(2, np.inf)  # of the robot at the last plan, and where it has stayed since
        self._anchored = 0

    def wants_a_plan(self, place: np.ndarray) -> bool:
        """Count a control step; return whether the plan is old, or its goal is seen or the path's end is reached."""
        self._step += 1
        self._start = place if self._start is None else self._start
        if self.path is None or self.goal is None or self._step - self._planned >= _REPLAN_STEPS:
            return True
        return self.ground.has_seen(self.goal) or bool(np.linalg.norm(self.path[-1] - place) < 0.5)

    def look_around(self, place: np.ndarray) -> Situation | None:
        """Return what there is to decide at a place (2,) m; None if no frontier can be reached.

        Where none is near, rock that may be a floor is doubted, if the ground has such rock.
        """
        self._place = place.copy()
        if not np.linalg.norm(place - self._anchor) <= STILL_M:
            self._anchor, self._anchored = place.copy(), self._step
        found = self._situation(place)
        for doubt in self.ground.doubts():
            if (found is None or found.costs.min() > _FAR_M) and doubt():
                self._beside.clear()
                found = self._situation(place)
            if found is not None:
                break
        return found

    def _situation(self, place: np.ndarray) -> Situation | None:
        given_up = [cell for cell, steps in self._beside.items() if steps > GIVE_UP_STEPS]
        (graph,) = self.ground.graphs(given_up, place if self._start is None else self._start, self._region_m)
        if graph is None:
            return None
        robot = graph.nearest(place)
        costs, self._before = (row[0] for row in graph.costs_from([robot]))
        self._since = {cell: self._since.get(cell, self._step) for cell in _cells(graph, graph.cluster > 0)}
        goals, sizes, ages, kept = [], [], [], []
        for number in np.unique(graph.cluster[(graph.cluster > 0) & np.isfinite(costs)]).tolist():
            members = np.flatnonzero(graph.cluster == number)
            cells = _cells(graph, members)
            goals.append(int(members[costs[members].argmin()]))
            sizes.append(len(members))
            ages.append(self._step - max(self._since[cell] for cell in cells))
            kept.append(self.goal in cells)
        if not goals:
            return None
        present = kept.index(True) if True in kept else -1
        near = costs[goals] - HYSTERESIS_M * np.array(kept)
        return Situation(graph, robot, np.array(goals), np.array(sizes), near, np.array(ages), present)

    def head_for(self, situation: Situation | None, chosen: int | None) -> None:
        """Take the path to a cluster; without one there is no path."""
        passed, self._planned = self._step - self._planned, self._step
        if situation is None or chosen is None:
            self.path, self.goal = None, None
            return
        node = int(situation.goals[chosen])
        (goal,) = _cells(situation.graph, [node])
        self.path = situation.graph.path(self._place, self._before, node)
        still = self._step - self._anchored > STILL_STEPS
        if goal == self.goal and (still or situation.costs[chosen] < BESIDE_M):
            self._beside[goal] = self._beside.get(goal, 0) + passed
        self.steps_to_goal = self.steps_to_goal + passed if chosen == situation.present else 0
        self.goal = goal


def _cells(graph: MapGraph, nodes: np.ndarray | list[int]) -> list[GoalCell]:
    return [tuple(cell) for cell in graph.cells[nodes].tolist()]
