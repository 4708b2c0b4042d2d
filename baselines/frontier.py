"""Frontier exploration: drive to the border between seen and unseen, the nearest one or the one that promises most."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt
from skimage.graph import MCP_Geometric

from baselines import mapping, pursuit
from baselines.mapping import FINE, ROCK, UNKNOWN, OwnMap
from baselines.policy import ranges_m
from minexplore.task import TaskParams

_REPLAN = 15  # control steps
_HARD_M, _SOFT_M = 0.45, 1.1  # from rock: no way; dearer the nearer
_TRIES = 60  # control steps beside a frontier that stays unseen before it is given up
_LOYAL_M = 3.0
_DECAY_PER_M = 0.05  # of what a frontier promises, by the way to it


class NearestFrontier:
    """Plans on its own map to the nearest unseen cell that free ground leads to (Yamauchi 1997), and drives there.

    The map is made from the sixteen beams and the true pose, as is usual: localisation is not what is compared.
    """

    builds_on = (mapping, pursuit)

    def __init__(self, robots: int, task: TaskParams) -> None:
        """Start with empty maps."""
        self._task = task
        bearings = 2 * np.pi * np.arange(task.beams) / task.beams
        self._bearings = (bearings + np.pi) % (2 * np.pi) - np.pi
        self._minds = [_Mind(task) for _ in range(robots)]

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Forget the maps of robots (k,)."""
        for robot in robots.tolist():
            self._minds[robot] = _Mind(self._task)

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        ranges = ranges_m(observation, self._task)
        return np.array([self._drive(*each) for each in zip(self._minds, info["pose_m_rad"], ranges, strict=True)])

    def _drive(self, mind: _Mind, pose: np.ndarray, ranges: np.ndarray) -> tuple[float, float]:
        mind.map.add(pose[:2], pose[2] + self._bearings, ranges, self._task.range_m[1])
        mind.since += 1
        if mind.path is None or mind.since >= _REPLAN or mind.arrived(pose[:2]):
            mind.plan(pose[:2], self.choose)
        if mind.path is None:
            return 0.0, 0.5  # nothing left to see: look round
        return pursuit.follow(mind.path, pose, self._bearings, ranges, self._task.max_turn_radps)

    def choose(self, own: OwnMap, frontier: np.ndarray, costs: np.ndarray) -> int:
        """Return which frontier cell (k, 2) to go to, by the costs (k,) of the way there, m or dearer."""
        return int(costs.argmin())


class InformationGain(NearestFrontier):
    """Goes to the frontier where many unseen cells lie in view for the way it takes (Gonzalez-Banos & Latombe 2002)."""

    def choose(self, own: OwnMap, frontier: np.ndarray, costs: np.ndarray) -> int:
        """Return the frontier with the greatest promise, gain * exp(-way / 20 m)."""
        gain = np.array([_promise(own, cell, self._task.range_m[1]) for cell in frontier])
        return int((gain * np.exp(-_DECAY_PER_M * costs)).argmax())


class _Mind:
    """One robot's map and plan."""

    def __init__(self, task: TaskParams) -> None:
        self.map, self._region_m = OwnMap(task.cell_m), task.region_m
        self._start: np.ndarray | None = None
        self.path: np.ndarray | None = None
        self.goal: tuple[int, int] | None = None  # coverage cell (col, row), counted from the mine frame's origin
        self.since = 0
        self.tries: dict[tuple[int, int], int] = {}

    def arrived(self, place: np.ndarray) -> bool:
        """Say whether the goal was seen, or the path's end is reached."""
        if self.goal is None or self.path is None:
            return True
        col, row = np.array(self.goal) - self.map.low
        return bool(self.map.seen[row, col]) or bool(np.linalg.norm(self.path[-1] - place) < 0.5)

    def plan(self, place: np.ndarray, choose: Any) -> None:
        """Find a way to a frontier; `path` is None when there is none."""
        own, since = self.map, self.since
        self.since, previous, self.goal, self.path = 0, self.goal, None, None
        frontier = own.frontier()
        for col, row in (np.array(cell) - own.low for cell, tries in self.tries.items() if tries > _TRIES):
            frontier[row, col] = False
        cells = np.argwhere(frontier)
        self._start = place if self._start is None else self._start
        off = (cells[:, ::-1] + 0.5 + own.low) * own.cell_m - self._start
        cells = cells[np.linalg.norm(off, axis=1) <= self._region_m]  # what lies beyond counts for nothing
        if not len(cells):
            return
        costs, ways, corner = self._ways(place, frontier)
        ends = cells * FINE + FINE // 2 - corner
        block = np.stack([costs[ends[:, 0] + i, ends[:, 1] + j] for i in (-2, 0, 2) for j in (-2, 0, 2)])
        best = block.min(axis=0)
        reachable = np.isfinite(best)
        if not reachable.any():
            return
        cells, best, block = cells[reachable], best[reachable] * own.fine_m, block[:, reachable]
        if previous is not None:  # another goal must be nearer by more than a whim
            best = best - _LOYAL_M * (cells[:, ::-1] + own.low == previous).all(axis=1)
        chosen = choose(own, cells, best)
        offset = np.array([(i, j) for i in (-2, 0, 2) for j in (-2, 0, 2)])[int(block[:, chosen].argmin())]
        way = np.array(ways.traceback(tuple(cells[chosen] * FINE + FINE // 2 + offset - corner)))
        self.path = own.centres(way + corner)
        self.goal = tuple((cells[chosen][::-1] + own.low).tolist())
        if self.goal == previous and len(self.path) < 8:
            self.tries[self.goal] = self.tries.get(self.goal, 0) + since

    def _ways(self, place: np.ndarray, frontier: np.ndarray) -> tuple[np.ndarray, MCP_Geometric, np.ndarray]:
        """Return costs, in fine cells, of the way to every fine cell: near rock it is dearer, unknown ground too.

        What is known lies in a window of the map; costs and ways are of that, and its corner (2,) is returned too.
        """
        own = self.map
        row, col = (int(v[0]) for v in own.at(place[None], own.fine_m))
        window, corner = _window(own.seen | frontier, (row // FINE, col // FINE))
        known = np.repeat(np.repeat((own.seen | frontier)[window], FINE, axis=0), FINE, axis=1)
        fine = own.fine[tuple(slice(FINE * s.start, FINE * s.stop) for s in window)]
        row, col = row - int(corner[0]), col - int(corner[1])
        off = distance_transform_edt(fine != ROCK) * own.fine_m
        cost = 1.0 + 6.0 * np.clip((_SOFT_M - off) / _SOFT_M, 0, 1) ** 2
        cost[fine == UNKNOWN] *= 1.5
        down, across = np.ogrid[: fine.shape[0], : fine.shape[1]]
        near = np.hypot(down - row, across - col) * own.fine_m < 0.7
        cost[~known | ((off < _HARD_M) & ~near) | (fine == ROCK)] = -1.0
        cost[row, col] = 1.0
        ways = MCP_Geometric(cost, fully_connected=True)
        return ways.find_costs([(row, col)])[0], ways, corner


def _promise(own: OwnMap, cell: np.ndarray, far_m: float) -> int:
    """Return how many unseen cells lie in view from a coverage cell, taking unknown ground for free."""
    centre, reach = cell * FINE + FINE // 2, int(far_m / own.cell_m) + 2
    angles = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    steps = np.arange(1, int(far_m / own.fine_m))
    at = centre + np.stack([np.sin(angles), np.cos(angles)], axis=-1)[:, None, :] * steps[:, None]
    row, col = np.rint(at).astype(int).transpose(2, 0, 1)
    inside = (row >= 0) & (col >= 0) & (row < own.fine.shape[0]) & (col < own.fine.shape[1])
    row, col = np.where(inside, row, 0), np.where(inside, col, 0)
    clear = np.cumsum(~inside | (own.fine[row, col] == ROCK), axis=1) == 0
    low, high = np.maximum(cell - reach, 0), cell + reach + 1
    inview = np.zeros_like(own.seen[low[0] : high[0], low[1] : high[1]])
    inview[row[clear] // FINE - low[0], col[clear] // FINE - low[1]] = True
    return int((inview & ~own.seen[low[0] : high[0], low[1] : high[1]]).sum())


def _window(known: np.ndarray, cell: tuple[int, int]) -> tuple[tuple[slice, slice], np.ndarray]:
    """Return the part of a map (rows, cols) that holds what is known, a cell, and two cells round both.

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
