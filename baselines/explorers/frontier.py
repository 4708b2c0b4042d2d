"""Frontier exploration: drive to the border of the seen area, to its nearest part or to the most promising one."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.base.beams import beam_ranges
from baselines.explorers.maps.own_map import FINE, ROCK, OwnMap
from baselines.explorers.planner import FrontierPlanner
from baselines.explorers.pursuit import PathFollower
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams

_REPLAN_STEPS = 15  # control steps between plans
_GAIN_DECAY_PER_M = 0.05
_VIEW_RAYS = 48


class NearestFrontier:
    """Plans on its own map to the nearest unseen cell that free ground leads to (Yamauchi 1997), and drives there.

    The map is built from the sixteen beams and the true pose. This is usual: localisation is not compared here.
    """

    def __init__(self, count: int, task: TaskParams, robot: RobotParams) -> None:
        """Start with empty maps."""
        self._task, self._robot = task, robot
        self._follower = PathFollower(task, robot)
        self._planners = [FrontierPlanner(task, robot) for _ in range(count)]

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Empty the maps of robots (k,)."""
        for robot in robots.tolist():
            self._planners[robot] = FrontierPlanner(self._task, self._robot)

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        ranges = beam_ranges(observation, self._task)
        return np.array([self._drive(*each) for each in zip(self._planners, info["pose_m_rad"], ranges, strict=True)])

    def _drive(self, planner: FrontierPlanner, pose: np.ndarray, ranges: np.ndarray) -> tuple[float, float]:
        planner.map.add(pose[:2], pose[2] + self._follower.bearings, ranges, self._task.range_m[1])
        planner.steps_since_plan += 1
        if planner.path is None or planner.steps_since_plan >= _REPLAN_STEPS or planner.arrived(pose[:2]):
            planner.plan(pose[:2], self.choose)
        if planner.path is None:
            return 0.0, 0.5  # no frontier is left: turn on the spot
        return self._follower.follow(planner.path, pose, ranges)

    def choose(self, own: OwnMap, frontier: np.ndarray, costs: np.ndarray) -> int:
        """Return the index of the frontier cell (k, 2) to drive to.

        `costs` (k,) are path lengths, m, lengthened near rock and in unknown ground.
        """
        return int(costs.argmin())


class InformationGain(NearestFrontier):
    """Drives to the frontier with the most unseen cells in view, discounted by distance (Gonzalez-Banos 2002)."""

    def choose(self, own: OwnMap, frontier: np.ndarray, costs: np.ndarray) -> int:
        """Return the index of the frontier with the greatest gain * exp(-path / 20 m)."""
        gain = np.array([_unseen_in_view(own, cell, self._task.range_m[1]) for cell in frontier])
        return int((gain * np.exp(-_GAIN_DECAY_PER_M * costs)).argmax())


def _unseen_in_view(own: OwnMap, cell: np.ndarray, far_m: float) -> int:
    """Return how many unseen cells beams from a coverage cell would cross if unknown ground were free."""
    centre, reach = cell * FINE + FINE // 2, int(far_m / own.cell_m) + 2
    angles = np.linspace(0, 2 * np.pi, _VIEW_RAYS, endpoint=False)
    steps = np.arange(1, int(far_m / own.fine_m))
    at = centre + np.stack([np.sin(angles), np.cos(angles)], axis=-1)[:, None, :] * steps[:, None]
    row, col = np.rint(at).astype(int).transpose(2, 0, 1)
    inside = (row >= 0) & (col >= 0) & (row < own.fine.shape[0]) & (col < own.fine.shape[1])
    row, col = np.where(inside, row, 0), np.where(inside, col, 0)
    clear = np.cumsum(~inside | (own.fine[row, col] == ROCK), axis=1) == 0
    low, high = np.maximum(cell - reach, 0), cell + reach + 1
    in_view = np.zeros_like(own.seen[low[0] : high[0], low[1] : high[1]])
    in_view[row[clear] // FINE - low[0], col[clear] // FINE - low[1]] = True
    return int((in_view & ~own.seen[low[0] : high[0], low[1] : high[1]]).sum())
