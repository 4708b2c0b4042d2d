"""Frontier exploration by a robot that flies: to the nearest free place beside cubes that nothing has passed yet."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.explorers.maps.volume_map import VolumeMap
from minexplore.physics.quadrotor import QuadrotorParams
from minexplore.task import TaskParams

_REPLAN_STEPS = 20  # control steps between plans
_LOOKAHEAD_M = 0.9
_ARRIVED_M = 0.4
_GIVE_UP_STEPS = 60  # control steps beside cubes that stay unseen
_ESCAPE_M = 1.0
_AWAY_M, _AWAY_GAIN = 0.45, 1.5  # beside the guard: what is nearer pushes the robot away
_SLOW_M = 1.6  # of free way ahead at full speed
_TURN = 0.3  # of the full turn rate, always: beams then pass between the places that they passed before


class NearestFrontierInVolume:
    """Plans on its own map of the volume, built from the beams and the true pose, as `NearestFrontier` does in plan."""

    def __init__(self, count: int, task: TaskParams, robot: QuadrotorParams) -> None:
        """Start with empty maps."""
        self._task, self._robot = task, robot
        self._beams = robot.beams(task.beams)
        self._pilots = [_Pilot(task, robot) for _ in range(count)]

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Empty the maps of robots (k,)."""
        for robot in robots.tolist():
            self._pilots[robot] = _Pilot(self._task, self._robot)

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 4)."""
        near, far = self._task.range_m
        ranges = near + observation[:, : len(self._beams)].astype(float) * (far - near)
        places = np.column_stack([info["pose_m_rad"][:, :2], info["height_m"]])
        axes = body_axes(info["pose_m_rad"][:, 2], info["pitch_rad"], info["roll_rad"])
        robots = zip(self._pilots, places, axes, ranges, strict=True)
        return np.array([pilot.fly(place, self._beams, turn, seen) for pilot, place, turn, seen in robots])


def body_axes(yaw: np.ndarray, pitch: np.ndarray, roll: np.ndarray) -> np.ndarray:
    """Return rotations (n, 3, 3), axes as columns, of robots by heading, rise of their nose and of their left side."""
    sin, cos = np.sin(pitch), np.cos(pitch)
    ahead = np.stack([cos * np.cos(yaw), cos * np.sin(yaw), sin], axis=1)
    level = np.stack([-np.sin(yaw), np.cos(yaw), np.zeros(len(yaw))], axis=1)
    share = np.clip(np.sin(roll) / cos, -1.0, 1.0)[:, None]
    left = np.sqrt(1 - share**2) * level + share * np.cross(ahead, level)
    return np.stack([ahead, left, np.cross(ahead, left)], axis=2)


class _Pilot:
    """One robot's map and path."""

    def __init__(self, task: TaskParams, robot: QuadrotorParams) -> None:
        self._task, self._robot, self.map = task, robot, VolumeMap(task.cell_m)
        self._path: np.ndarray | None = None
        self._since_plan, self._beside = 0, 0
        self._closed: set[tuple[int, ...]] = set()

    def fly(self, place: np.ndarray, beams: np.ndarray, axes: np.ndarray, ranges: np.ndarray) -> list[float]:
        """Return the commands (4,) of a robot at a place (3,) m with axes (3, 3) and ranges (n,) m."""
        self.map.add(place, beams @ axes.T, ranges, self._task.range_m[1])
        self._since_plan += 1
        arrived = self._path is None or float(np.linalg.norm(self._path[-1] - place)) < _ARRIVED_M
        if arrived or self._since_plan >= _REPLAN_STEPS:
            self._plan(place, arrived)
        wanted = np.zeros(3) if self._path is None else self._along(place) @ axes
        way = np.linalg.norm(wanted)
        if way > 0:
            aligned = beams @ (wanted / way) > 0.85
            free = float(ranges[aligned].min(initial=self._task.range_m[1])) - self._robot.radius_m
            wanted *= min(1.0, max(0.15, free / _SLOW_M)) / way
        close = np.maximum(0.0, self._robot.radius_m + _AWAY_M - ranges)
        push = wanted - _AWAY_GAIN * (beams * close[:, None]).sum(axis=0)
        return [float(v) for v in np.clip([*push, _TURN], -1.0, 1.0)]

    def _plan(self, place: np.ndarray, arrived: bool) -> None:
        self._beside = self._beside + self._since_plan if arrived else 0
        self._since_plan = 0
        if self._beside >= _GIVE_UP_STEPS:
            self._closed.update(self.map.unseen_beside(place))
            self._beside = 0
        self._path = self.map.path_to_frontier(place, _ESCAPE_M, self._closed)

    def _along(self, place: np.ndarray) -> np.ndarray:
        """Return the way (3,) m to the place of the path that is steered to."""
        assert self._path is not None
        apart = np.linalg.norm(self._path - place, axis=1)
        nearest = int(apart.argmin())
        ahead = nearest + int((apart[nearest:] < _LOOKAHEAD_M).sum())
        return self._path[min(ahead, len(self._path) - 1)] - place
