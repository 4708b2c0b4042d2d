"""The explorers for mines with heights: they choose as those for level mines do, on a map of layers."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.base.beams import beam_ranges
from baselines.explorers.frontier import _GAIN_DECAY_PER_M, _unseen_in_view
from baselines.explorers.graph_explorer import (
    _BESIDE_M,
    _GIVE_UP_STEPS,
    _HYSTERESIS_M,
    _REPLAN_STEPS,
    _STILL_STEPS,
    STILL_M,
    GraphExplorer,
    Situation,
)
from baselines.explorers.maps.layered_graph import LayerCell, LayeredGraph, LayerGraphs
from baselines.explorers.maps.layers import LayeredMap, Stance, stances_of
from baselines.explorers.tour import DepthFirst, FrontierTour, TwoLevel
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams

_FAR_M = 30.0  # a frontier so far away is farther than most that a doubt opens


class OverHeights(GraphExplorer):
    """A `GraphExplorer` whose map has layers; it needs height, pitch and roll of the robots beside their poses.

    Places and paths are those of the mine frame, in which a robot that drives from level to level moves on steadily.
    """

    def __init__(self, count: int, task: TaskParams, robot: RobotParams) -> None:
        """Start with empty maps."""
        super().__init__(count, task, robot)
        self._drivers: list[Any] = [_LayerDriver(task, robot) for _ in range(count)]

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Empty the maps of robots (k,)."""
        for robot in robots.tolist():
            self._drivers[robot] = _LayerDriver(self._task, self._robot)

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        ranges = beam_ranges(observation, self._task)
        robots = zip(self._drivers, stances_of(info), info["pose_m_rad"], ranges, strict=True)
        return np.array([self._drive_over(*each) for each in robots])

    def _drive_over(self, driver: Any, stance: Stance, pose: np.ndarray, ranges: np.ndarray) -> tuple[float, float]:
        bearings, sensor_m = self._follower.bearings, self._robot.sensor_height_m
        driver.map.add_scan(stance, bearings, ranges, sensor_m, self._task.range_m[1])
        if driver.wants_a_plan(pose[:2]):
            situation = driver.look_around(pose[:2])
            driver.head_for(situation, None if situation is None else self._choose(driver, situation))
        if driver.path is None:
            return 0.0, 0.5  # no frontier is left: turn on the spot
        return self._follower.follow(driver.path, pose, ranges)


class _LayerDriver:
    """One robot's map, goal and path, as `GraphExplorer` keeps them on a level map."""

    def __init__(self, task: TaskParams, robot: RobotParams) -> None:
        self.map, self._graphs = LayeredMap(task.cell_m), LayerGraphs(robot.radius_m)
        self.path: np.ndarray | None = None
        self.steps_to_goal = 0  # since the present goal's cluster was chosen
        self._region_m = task.region_m
        self._start: np.ndarray | None = None
        self._goal: LayerCell | None = None
        self._step = self._planned = 0
        self._since: dict[LayerCell, int] = {}  # the step at which each cell of the frontier came into it
        self._beside: dict[LayerCell, int] = {}
        self._before = np.zeros(0)
        self._place = self._anchor = np.full(2, np.inf)  # of the robot at the last plan, and where it has stayed since
        self._anchored = 0

    def wants_a_plan(self, place: np.ndarray) -> bool:
        """Count a control step; return whether the plan is old, or its goal is seen or the path's end is reached."""
        self._step += 1
        self._start = place if self._start is None else self._start
        if self.path is None or self._goal is None or self._step - self._planned >= _REPLAN_STEPS:
            return True
        *cell, layer = self._goal
        return bool(self.map.layers[layer].has_seen(np.array(cell))[0]) or bool(
            np.linalg.norm(self.path[-1] - place) < 0.5
        )

    def look_around(self, place: np.ndarray) -> Situation | None:
        """Return what there is to decide at a place (2,) m; None if no frontier can be reached.

        Where none is near, rock nearby that may be a floor that rises is doubted, so that the robot drives there; where
        none is left, all such rock.
        """
        self._place = place.copy()
        if not np.linalg.norm(place - self._anchor) <= STILL_M:
            self._anchor, self._anchored = place.copy(), self._step
        found = self._situation(place)
        for layers in ([self.map.layer, *self.map.beside(self.map.layer)], list(self.map.layers)):
            if (found is None or found.costs.min() > _FAR_M) and self.map.doubt(layers):
                self._graphs.forget()
                self._beside.clear()
                found = self._situation(place)
            if found is not None:
                break
        return found

    def _situation(self, place: np.ndarray) -> Situation | None:
        given_up = [cell for cell, steps in self._beside.items() if steps > _GIVE_UP_STEPS]
        graph = self._graphs.graph(self.map, given_up, place if self._start is None else self._start, self._region_m)
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
            kept.append(self._goal in cells)
        if not goals:
            return None
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
        (goal,) = _cells(situation.graph, [node])
        self.path = situation.graph.path(self._place, self._before, node)
        still = self._step - self._anchored > _STILL_STEPS
        if goal == self._goal and (still or situation.costs[chosen] < _BESIDE_M):
            self._beside[goal] = self._beside.get(goal, 0) + passed
        self.steps_to_goal = self.steps_to_goal + passed if chosen == situation.present else 0
        self._goal = goal


def _cells(graph: Any, nodes: np.ndarray | list[int]) -> list[LayerCell]:
    return [(col, row, layer) for col, row, layer in graph.cells[nodes].tolist()]


class NearestFrontierOverHeights(OverHeights):
    """Drives to the nearest cluster of the frontier."""


class InformationGainOverHeights(OverHeights):
    """Drives to the cluster with the most unseen cells in view, discounted by distance, as `InformationGain` does."""

    def choose(self, situation: Situation) -> int:
        """Return the index of the cluster with the greatest gain * exp(-path / 20 m)."""
        graph = situation.graph
        assert isinstance(graph, LayeredGraph)
        gains = []
        for col, row, layer in graph.cells[situation.goals].tolist():
            own = graph.parts[layer].own
            gains.append(_unseen_in_view(own, np.array([row, col]) - own.low[::-1], self._task.range_m[1]))
        return int((np.array(gains) * np.exp(-_GAIN_DECAY_PER_M * situation.costs)).argmax())


class FrontierTourOverHeights(OverHeights, FrontierTour):
    """`FrontierTour` on a map of layers."""


class DepthFirstOverHeights(OverHeights, DepthFirst):
    """`DepthFirst` on a map of layers."""


class TwoLevelOverHeights(OverHeights, TwoLevel):
    """`TwoLevel` on a map of layers."""
