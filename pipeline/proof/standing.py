"""Whether robots stand and climb on the floor of a world: at rest they stay, and at a creep they drive uphill."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from minexplore.envs.robot_batch import RobotBatch
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from minexplore.world import World, load_world

_GRAVITY_MPS2 = 9.81
# Rise over run. On an even plane of 0.2 the robot creeps by 2 mm in 5 s, of 0.25 by 1 cm, of 0.36 by 10 cm: its castors
# bear weight and have no friction. On steeper floors it slides, whatever the floor is like.
STEEPEST = 0.2
_RAMP = 0.03  # rise over run of the flattest place that counts as uphill
_SLOW_MPS = 0.15  # a tenth of full speed: too slow to roll over a ridge
_SETTLE_S, _REST_S, _CLIMB_S = 1.0, 5.0, 3.0
_AHEAD_M = 0.7  # a climbing robot needs 0.6 m
_SPARE_M = 0.1  # beside a robot's disc
_AROUND_M, _RING = (0.4, 0.8), 8  # a robot's length about a place, where its wheels and castors come to
_ROBOTS = 64


@dataclass(frozen=True)
class Standing:
    """How far a robot at rest moves in 5 s (m, the largest), and the share of robots at 0.15 m/s that gain uphill.

    A robot's wheels turn at a finite gain under its weight; `rest_drift_m` is what it moves beyond that.
    """

    rest_drift_m: float
    climb_share: float


@dataclass(frozen=True)
class _StandingPlaces:
    """Places (n, 2) m of the plan where robots fit, and the rise over run (n, 2) east and north there."""

    plan_m: np.ndarray
    slope: np.ndarray

    @property
    def steepness(self) -> np.ndarray:
        """Return the rise over run (n,) along the steepest way."""
        return np.hypot(*self.slope.T)

    def some(self, rows: np.ndarray) -> _StandingPlaces:
        """Return the places of some rows."""
        return _StandingPlaces(self.plan_m[rows], self.slope[rows])


def measure_standing(bundle: Path, seed: int, robots: int = _ROBOTS) -> Standing:
    """Measure how robots rest and climb at random places of a world.

    The ground is dry everywhere, as zones of little friction hold no robot on a steep ramp, and no speed has noise.
    Floors steeper than `STEEPEST` are left out: there the robot slides on an even plane too.
    Where no robot fits on a ramp, none fails to climb.

    Parameters
    ----------
    bundle : Path
    seed : int
        Of the places and headings.
    robots : int
        That rest, and so many more that climb.
    """
    world, robot, rng = load_world(bundle), RobotParams(), np.random.default_rng(seed)
    places = _places_of(world, robot)
    rest = places.some(rng.integers(len(places.plan_m), size=robots))
    heading = rng.uniform(-np.pi, np.pi, robots)
    uphill = places.some(np.flatnonzero(places.steepness >= _RAMP))
    ahead = uphill.plan_m + _AHEAD_M * uphill.slope / uphill.steepness[:, None]
    uphill = uphill.some(np.flatnonzero(_fits(world, ahead, robot.radius_m + _SPARE_M)))
    if len(uphill.plan_m):
        uphill = uphill.some(rng.integers(len(uphill.plan_m), size=robots))
    return Standing(_rest_drift_m(world, robot, rest, heading), _climb_share(world, robot, uphill))


def _places_of(world: World, robot: RobotParams) -> _StandingPlaces:
    """Return the places where a robot fits and the floor about them is nowhere steeper than `STEEPEST`."""
    plan = world.places_m(robot.radius_m + _SPARE_M)
    places = _StandingPlaces(plan, _slope_at(world, plan))
    steepest = places.steepness
    angles = np.arange(_RING) * (2 * np.pi / _RING)
    for beside in (r * np.array([np.cos(a), np.sin(a)]) for r in _AROUND_M for a in angles):
        steepest = np.maximum(steepest, np.hypot(*_slope_at(world, plan + beside).T))
    return places.some(np.flatnonzero(steepest <= STEEPEST))


def _slope_at(world: World, plan_m: np.ndarray) -> np.ndarray:
    """Return the rise over run (n, 2), east and north, of the floor at places (n, 2) m of the plan."""
    normal = np.tile([0.0, 0.0, 1.0], (len(plan_m), 1))
    if not world.floor.is_flat:
        normal[:, :2] = -world.floor.planes[world.floor.faces_at(plan_m)][:, :2]
    up = world.T_world_mine[:3, :3].T[:, 2]
    slope: np.ndarray = up[:2] / up[2] - normal[:, :2]
    return slope


def _fits(world: World, plan_m: np.ndarray, clearance_m: float) -> np.ndarray:
    """Return which places (n, 2) m of the plan have a clearance."""
    col, row = np.floor((plan_m - world.origin_m) / world.cell_m).astype(int).T
    height, width = world.clearance_m.shape
    inside = (row >= 0) & (row < height) & (col >= 0) & (col < width)
    found = world.clearance_m[np.where(inside, row, 0), np.where(inside, col, 0)]
    return inside & (found >= clearance_m)


def _rest_drift_m(world: World, robot: RobotParams, places: _StandingPlaces, heading: np.ndarray) -> float:
    """Return the largest distance, m, that robots move at the command zero, beyond what their wheels turn."""
    moved = _drive(world, robot, places, heading, 0.0, _REST_S)
    drift = np.linalg.norm(moved, axis=1) - turned_m(robot, places.steepness, _REST_S)
    return round(float(np.maximum(0.0, drift).max(initial=0.0)), 4)


def turned_m(robot: RobotParams, steepness: np.ndarray, time_s: float) -> np.ndarray:
    """Return how far, m, a robot's wheels turn under its weight in a time, at the command zero."""
    down = steepness / np.sqrt(1 + steepness**2)
    torque = robot.mass_kg * _GRAVITY_MPS2 * down * robot.wheel_radius_m / 2 - robot.wheel_friction_nm
    turned: np.ndarray = np.maximum(0.0, torque) / robot.wheel_gain_nms * robot.wheel_radius_m * time_s
    return turned


def _climb_share(world: World, robot: RobotParams, places: _StandingPlaces) -> float:
    """Return the share of robots that gain uphill when they face it at a creep."""
    if not len(places.plan_m):
        return 1.0
    heading = np.array([math.atan2(y, x) for x, y in places.slope.tolist()])
    moved = _drive(world, robot, places, heading, _SLOW_MPS, _CLIMB_S)
    return float(((moved[:, :2] * places.slope).sum(axis=1) > 0).mean())


def _drive(
    world: World, robot: RobotParams, places: _StandingPlaces, heading: np.ndarray, speed_mps: float, time_s: float
) -> np.ndarray:
    """Return how far (n, 3) m, mine frame, robots at places move in a time at a speed, after they have settled."""
    task, count = TaskParams(terrain=False), len(places.plan_m)
    batch = RobotBatch(world, task, robot, count)
    for k in range(count):
        x, y = places.plan_m[k]
        batch.place(k, x, y, heading[k])
    command = np.tile([speed_mps / task.max_forward_mps, 0.0], (count, 1))
    rngs = [np.random.default_rng(0)] * count  # nothing is drawn on dry ground
    track = [batch.qpos[:, :3].copy()]
    for _ in range(round((_SETTLE_S + time_s) / task.control_s)):
        batch.drive(command, rngs, np.arange(count))
        track.append(batch.qpos[:, :3].copy())
    batch.close()
    moved: np.ndarray = (track[-1] - track[round(_SETTLE_S / task.control_s)]) @ world.T_world_mine[:3, :3]
    return moved
