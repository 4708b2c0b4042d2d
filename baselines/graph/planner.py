"""One simulated robot's map, goal and path: it decides when and among what the classical graph explorers do."""

from __future__ import annotations

import numpy as np

from baselines.explorers.graph_explorer import (
    BESIDE_M,
    GIVE_UP_STEPS,
    HYSTERESIS_M,
    STILL_M,
    STILL_STEPS,
    Situation,
)
from baselines.explorers.maps.own_map import FINE, OwnMap
from baselines.graph.growing_graph import GrowingGraph
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams


class ClusterPlanner:
    """What `baselines.explorers.graph_explorer` keeps of a robot, on a map of fixed extent.

    Steps are control steps of the task.
    """

    def __init__(self, own: OwnMap, task: TaskParams, robot: RobotParams, start: np.ndarray, replan_steps: int) -> None:
        """Begin an episode at a place (2,) m, with an empty map."""
        self.map, self.graph = own, GrowingGraph(own, robot.radius_m)
        self.path: np.ndarray | None = None
        self.goal: tuple[int, int] | None = None  # column and row of the coverage cell
        self.steps_to_goal = 0  # since the present goal's cluster was chosen
        self.step = self.planned = 0
        self.changed = [*own.seen.shape, 0, 0]  # rows and columns since the last plan: least, most + 1
        self._worth = np.ones_like(own.seen)
        if np.isfinite(task.region_m):
            rows, cols = np.indices(own.seen.shape)
            places = (np.stack([cols, rows], axis=-1) + 0.5 + own.low) * own.cell_m
            self._worth = np.linalg.norm(places - start, axis=-1) <= task.region_m
        self._since = np.full(own.seen.shape, -1)  # the step at which each cell came into the frontier
        self._beside: dict[tuple[int, int], int] = {}
        self._replan_steps = replan_steps
        self.start = start.copy()
        self._anchor, self._anchored = start.copy(), 0
        self._fine, self._seen = own.fine.copy(), own.seen.copy()  # the map at the last plan
        self._before = np.zeros(0)
        self._place = start.copy()  # of the robot at the last plan

    @property
    def still_steps(self) -> int:
        """Return for how many steps the robot has been within a metre of one place."""
        return self.step - self._anchored

    def wants_a_plan(self, place: np.ndarray) -> bool:
        """Return whether the plan is old, or its goal is seen or reached."""
        if self.path is None or self.goal is None or self.step - self.planned >= self._replan_steps:
            return True
        col, row = self.goal[0] - self.map.low[0], self.goal[1] - self.map.low[1]
        return bool(self.map.seen[row, col]) or bool(np.hypot(*(self.path[-1] - place)) < 0.5)

    def look_around(self, place: np.ndarray) -> Situation | None:
        """Return what there is to decide at a place (2,) m; None if no frontier can be reached."""
        self._place = place.copy()
        if np.hypot(*(place - self._anchor)) > STILL_M:
            self._anchor, self._anchored = place.copy(), self.step
        self._update_graph()
        graph = self.graph.graph(self._worth)
        if not len(graph.cells):
            return None
        robot = graph.nearest(place)
        costs, self._before = (row[0] for row in graph.costs_from([robot]))
        edge = np.flatnonzero(graph.cluster > 0)
        col, row = (graph.cells[edge] - self.map.low).T
        since = np.where(self._since[row, col] < 0, self.step, self._since[row, col])
        self._since[:] = -1
        self._since[row, col] = since
        edge_costs, number = costs[edge], graph.cluster[edge]
        order = np.lexsort((edge, edge_costs, number))  # the cheapest cell of each cluster first
        reached = order[np.isin(number[order], np.unique(number[np.isfinite(edge_costs)]))]
        if not len(reached):
            return None
        first = np.flatnonzero(np.diff(number[reached], prepend=-1))
        goals, sizes = edge[reached[first]], np.diff(np.append(first, len(reached)))
        ages = self.step - np.maximum.reduceat(since[reached], first)
        kept = np.zeros(len(goals), dtype=bool)
        if self.goal is not None:
            here = (graph.cells[edge] == self.goal).all(axis=1)
            kept = np.isin(number[reached[first]], number[here])
        present = int(kept.argmax()) if kept.any() else -1
        return Situation(graph, robot, goals, sizes, costs[goals] - HYSTERESIS_M * kept, ages, present)

    def _update_graph(self) -> None:
        """Bring the graph up to date where the map is another than at the last plan."""
        first, left, end, right = self.changed
        fine = (slice(first * FINE, end * FINE), slice(left * FINE, right * FINE))
        window = (slice(first, end), slice(left, right))
        other = self.map.fine[fine] != self._fine[fine]
        height, width = max(end - first, 0), max(right - left, 0)
        cells = other.reshape(height, FINE, width, FINE).any(axis=(1, 3)) | (
            self.map.seen[window] != self._seen[window]
        )
        rows, cols = np.flatnonzero(cells.any(axis=1)), np.flatnonzero(cells.any(axis=0))
        if len(rows):
            self._fine[fine], self._seen[window] = self.map.fine[fine], self.map.seen[window]
            box = (first + rows[0], first + rows[-1] + 1, left + cols[0], left + cols[-1] + 1)
            self.graph.update((int(box[0]), int(box[1]), int(box[2]), int(box[3])))
        self.changed = [*self.map.seen.shape, 0, 0]

    def head_for(self, situation: Situation | None, chosen: int | None) -> None:
        """Take the path to a cluster; without one there is no path."""
        passed, self.planned = self.step - self.planned, self.step
        if situation is None or chosen is None:
            self.path, self.goal = None, None
            return
        node = int(situation.goals[chosen])
        goal = (int(situation.graph.cells[node, 0]), int(situation.graph.cells[node, 1]))
        self.path = situation.graph.path(self._place, self._before, node)
        still = self.still_steps > STILL_STEPS
        if goal == self.goal and (still or situation.costs[chosen] < BESIDE_M):
            self._beside[goal] = self._beside.get(goal, 0) + passed
            if self._beside[goal] > GIVE_UP_STEPS:
                self._worth[goal[1] - self.map.low[1], goal[0] - self.map.low[0]] = False
        self.steps_to_goal = self.steps_to_goal + passed if chosen == situation.present else 0
        self.goal = goal
