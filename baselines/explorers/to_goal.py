"""Drivers to a goal: one plans on the map of the mine, one has no map and follows the goal's bearing."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np

from baselines.base.beams import beam_ranges
from baselines.explorers.pursuit import PathFollower, Steering
from minexplore.envs.robot_batch import RobotBatch
from minexplore.physics.robot import RobotParams
from minexplore.tasks.goto import GoTo
from minexplore.tasks.ways import WayField

_NEAR_ROCK_M, _NEAR_ROCK_PENALTY = 1.1, 6.0  # ways cost up to 1 + 6 times their length nearer to rock than this
_REPLAN_STEPS = 5  # control steps
_SPACING_M = 0.3  # of the places of a path that is followed
_OPEN_M = 3.0  # free range at which a direction is open
_KEEP = 0.5  # of the turn away from the direction that was taken last, beside that away from the goal


class OnMap:
    """Plans the shortest way over the bundle's cells, away from rock where there is room, and follows it.

    It knows the mine, the true pose and the goal.
    """

    def __init__(self, robots: RobotBatch) -> None:
        """Take an environment's robots, whose task has a goal."""
        rules = robots.rules
        assert isinstance(rules, GoTo)
        self._rules, self._task = rules, robots.task
        ways = rules.ways
        near = np.clip(1.0 - ways.clearance_m / _NEAR_ROCK_M, 0.0, 1.0) ** 2
        cost = np.append(_NEAR_ROCK_PENALTY * near, 0.0).astype(np.float32)
        self._ways = replace(ways, lengths_m=ways.lengths_m * (1.0 + (cost[:-1, None] + cost[ways.beside]) / 2))
        self._follower = PathFollower(robots.task, cast(RobotParams, robots.robot))
        self._fields: list[WayField | None] = [None] * robots.count
        self._paths: list[np.ndarray] = [np.zeros((0, 2))] * robots.count
        self._step = 0

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        ranges = beam_ranges(observation, self._task)
        if self._step % _REPLAN_STEPS == 0:
            self._paths = [self._plan(robot) for robot in range(len(observation))]
        self._step += 1
        return np.array([self._follow(*each) for each in zip(self._paths, info["pose_m_rad"], ranges, strict=True)])

    def _follow(self, path: np.ndarray, pose: np.ndarray, ranges: np.ndarray) -> tuple[float, float]:
        return self._follower.follow(path, pose, ranges) if len(path) else (0.0, 0.5)

    def _plan(self, robot: int) -> np.ndarray:
        """Return the path (k, 2) m of a robot, close places that begin where it is."""
        rules, goal = self._rules, int(self._rules.goal[robot])
        field = self._fields[robot]
        if field is None or field.place != goal:
            field = self._fields[robot] = WayField(self._ways, goal)
        places = np.vstack([rules.last_m[robot, :2], self._ways.places_m[field.way(rules.last_m[robot]), :2]])
        along = np.append(0.0, np.cumsum(np.hypot(*np.diff(places, axis=0).T)))
        at = np.linspace(0.0, along[-1], max(2, int(along[-1] / _SPACING_M)))
        return np.column_stack([np.interp(at, along, places[:, axis]) for axis in (0, 1)])


class WithoutMap:
    """Turns to the goal, or to the open direction nearest to it, and drives; it has no memory but the last direction.

    Where no way leads on in the direction of the goal, as in a dead end, it stays.
    """

    def __init__(self, robots: RobotBatch) -> None:
        """Take an environment's robots, whose task has a goal."""
        self._task, self._heights = robots.task, robots.world.has_heights
        self._steering = Steering(robots.task, cast(RobotParams, robots.robot))
        self._last = np.zeros(robots.count)

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        ranges = beam_ranges(observation, self._task)
        goal = np.arctan2(observation[:, -2], observation[:, -3]) if self._heights else observation[:, -1]
        away = np.hypot(observation[:, -2], observation[:, -3]) if self._heights else observation[:, -2]
        bearings, beams = self._steering.bearings, np.arange(len(goal))
        open_m = np.minimum(_OPEN_M, away)[:, None]
        # A direction is open where its beam and those beside it see no rock.
        free = np.minimum(ranges, np.minimum(np.roll(ranges, 1, axis=1), np.roll(ranges, -1, axis=1)) * 2)
        turn = np.abs(_wrapped(bearings - goal[:, None])) + _KEEP * np.abs(_wrapped(bearings - self._last[:, None]))
        chosen = bearings[np.where(free >= open_m, turn, turn + 10.0 - free).argmin(axis=1)]
        nearest = np.abs(_wrapped(bearings - goal[:, None])).argmin(axis=1)
        error = np.where(free[beams, nearest] >= open_m[:, 0], goal, chosen)
        commands = self._steering.commands(error, ranges)
        self._last = _wrapped(error - commands[:, 1] * self._task.max_turn_radps * self._task.control_s)
        return commands


def _wrapped(angle: np.ndarray) -> np.ndarray:
    """Return angles, rad, between -pi and pi."""
    found: np.ndarray = (angle + np.pi) % (2 * np.pi) - np.pi
    return found


DRIVERS: dict[str, type[OnMap] | type[WithoutMap]] = {"planner": OnMap, "map-free": WithoutMap}
