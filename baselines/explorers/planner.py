"""Plans of frontier exploration: the cheapest paths on a robot's own map, and the frontier that it drives to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from skimage.graph import MCP_Geometric

from baselines.explorers.maps.own_map import FINE, ROCK, UNKNOWN, OwnMap
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams

GOAL_HYSTERESIS_M = 3.0  # a new goal must be this much nearer than the present one
_MARGIN_M = 0.1  # between the robot's disc and rock
_NEAR_ROCK_M, _NEAR_ROCK_PENALTY = 1.1, 6.0  # paths cost up to 1 + 6 times their length nearer to rock than this
_UNKNOWN_FACTOR = 1.5  # of the cost in unknown ground
_ESCAPE_M = 0.7  # around the robot, which may stand too near to rock
_GIVE_UP_STEPS = 60  # control steps beside a frontier that stays unseen
_SHORT_PATH = 8  # fine cells: the robot is beside its frontier
_ENDS = [(i, j) for i in (-2, 0, 2) for j in (-2, 0, 2)]  # fine cells of a coverage cell at which a path may end

Choose = Callable[[OwnMap, np.ndarray, np.ndarray], int]


@dataclass(frozen=True)
class _Paths:
    """Costs, in fine cells, of the cheapest paths to the fine cells of a window with its south-west corner (2,)."""

    costs: np.ndarray
    tree: MCP_Geometric
    corner: np.ndarray


class FrontierPlanner:
    """One robot's map, goal and path."""

    def __init__(self, task: TaskParams, robot: RobotParams) -> None:
        """Start with an empty map."""
        self.map = OwnMap(task.cell_m)
        self.path: np.ndarray | None = None  # (n, 2) m; None while there is no frontier to drive to
        self.steps_since_plan = 0
        self._goal: tuple[int, int] | None = None  # coverage cell (col, row), counted from the mine frame's origin
        self._steps_beside: dict[tuple[int, int], int] = {}
        self._start: np.ndarray | None = None
        self._region_m, self._clear_m = task.region_m, robot.radius_m + _MARGIN_M

    def arrived(self, place: np.ndarray) -> bool:
        """Return whether the goal was seen or the end of the path is reached."""
        if self._goal is None or self.path is None:
            return True
        col, row = np.array(self._goal) - self.map.low
        return bool(self.map.seen[row, col]) or bool(np.linalg.norm(self.path[-1] - place) < 0.5)

    def plan(self, place: np.ndarray, choose: Choose) -> None:
        """Plan a path from a place (2,) m to the frontier that `choose` selects; without one, `path` is None."""
        own, steps, previous = self.map, self.steps_since_plan, self._goal
        self.steps_since_plan, self._goal, self.path = 0, None, None
        self._start = place if self._start is None else self._start
        frontier, cells = self._frontier(self._start)
        if not len(cells):
            return
        paths = self._paths(place, frontier)
        ends = (cells * FINE + FINE // 2 - paths.corner)[:, None] + _ENDS
        end_costs = paths.costs[ends[..., 0], ends[..., 1]]
        reachable = np.isfinite(end_costs).any(axis=1)
        if not reachable.any():
            return
        cells, ends, end_costs = cells[reachable], ends[reachable], end_costs[reachable]
        costs = end_costs.min(axis=1) * own.fine_m
        if previous is not None:
            costs = costs - GOAL_HYSTERESIS_M * (cells[:, ::-1] + own.low == previous).all(axis=1)
        chosen = choose(own, cells, costs)
        end = ends[chosen, int(end_costs[chosen].argmin())]
        self.path = own.centres(np.array(paths.tree.traceback(tuple(end))) + paths.corner)
        self._goal = tuple((cells[chosen][::-1] + own.low).tolist())
        if self._goal == previous and len(self.path) < _SHORT_PATH:
            self._steps_beside[self._goal] = self._steps_beside.get(self._goal, 0) + steps

    def _frontier(self, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the frontier as a mask (rows, cols), and its cells (k, 2) inside the task's region."""
        own = self.map
        frontier = own.frontier()
        for col, row in (np.array(cell) - own.low for cell, n in self._steps_beside.items() if n > _GIVE_UP_STEPS):
            frontier[row, col] = False
        cells = np.argwhere(frontier)
        from_start = (cells[:, ::-1] + 0.5 + own.low) * own.cell_m - start
        return frontier, cells[np.linalg.norm(from_start, axis=1) <= self._region_m]

    def _paths(self, place: np.ndarray, frontier: np.ndarray) -> _Paths:
        """Return the cheapest paths from a place over seen and frontier cells."""
        own = self.map
        row, col = (int(v[0]) for v in own.at(place[None], own.fine_m))
        window, corner = _window(own.seen | frontier, (row // FINE, col // FINE))
        allowed = np.repeat(np.repeat((own.seen | frontier)[window], FINE, axis=0), FINE, axis=1)
        fine = own.fine[tuple(slice(FINE * s.start, FINE * s.stop) for s in window)]
        row, col = row - int(corner[0]), col - int(corner[1])
        clearance = distance_transform_edt(fine != ROCK) * own.fine_m
        cost = 1.0 + _NEAR_ROCK_PENALTY * np.clip((_NEAR_ROCK_M - clearance) / _NEAR_ROCK_M, 0, 1) ** 2
        cost[fine == UNKNOWN] *= _UNKNOWN_FACTOR
        down, across = np.ogrid[: fine.shape[0], : fine.shape[1]]
        near = np.hypot(down - row, across - col) * own.fine_m < _ESCAPE_M
        cost[~allowed | ((clearance < self._clear_m) & ~near) | (fine == ROCK)] = -1.0
        cost[row, col] = 1.0
        tree = MCP_Geometric(cost, fully_connected=True)
        return _Paths(tree.find_costs([(row, col)])[0], tree, corner)


def _window(known: np.ndarray, cell: tuple[int, int]) -> tuple[tuple[slice, slice], np.ndarray]:
    """Return the part of a map (rows, cols) that holds all known cells, one given cell, and two cells around them.

    Returns
    -------
    (slice, slice)
        Rows and columns, coverage cells.
    (2,) int
        Its corner, fine cells.
    """
    slices = []
    for axis in (0, 1):
        held = np.flatnonzero(known.any(axis=1 - axis))
        low, high = min(held[0], cell[axis]) - 2, max(held[-1], cell[axis]) + 3
        slices.append(slice(max(0, int(low)), min(known.shape[axis], int(high))))
    return (slices[0], slices[1]), FINE * np.array([slices[0].start, slices[1].start])
