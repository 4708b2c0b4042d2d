"""The collision stress test: robots are thrown at places where a wall could leak, and must never get out."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.envs.robot_batch import RobotBatch
from minexplore.physics.local_models import TILE_M
from minexplore.physics.robot import RobotParams
from minexplore.rotations import rotate_inverse
from minexplore.task import TaskParams
from minexplore.world import load_world
from pipeline.errors import GeometryError
from pipeline.geometry.rock.extrude import section_footprint
from pipeline.progress import progress

_FASTEST_MPS, _SPIN_RADPS = 3.0, 3.0
_RUN_UP_M = (0.05, 0.6)  # distance from the target minus the robot's radius
_STEPS = 8  # control steps after a throw: the robot arrives, slides and drives on
_ROBOTS = 256
_ON_WALL_M = 1e-3
_UPRIGHT = math.cos(math.radians(10.0))


@dataclass(frozen=True)
class StressTest:
    """Robot steps in contact with rock, thrown robots, escapes, largest depth of an upright robot in rock (m)."""

    contacts: int
    throws: int
    escapes: int
    deepest_m: float
    targets: dict[str, int]


def stress_walls(
    bundle: Path,
    free: Polygon,
    parts: list[np.ndarray],
    zone_edges_m: list[float],
    contacts: int,
    seed: int,
    threads: int = 1,
) -> StressTest:
    """Throw robots at corners, seams of parts, borders of zones and of local models, and random places of walls.

    A thrown robot starts towards the wall at up to 3 m/s and then drives at full throttle. It has escaped when its
    centre leaves the workings or is not between floor and roof.

    Parameters
    ----------
    bundle : Path
    free : shapely.Polygon, m, mine frame
    parts : list of (n, 3) float64, m, mine frame
        The convex parts, whose seams are targets.
    zone_edges_m : list of float
        Eastings of the floor zones' borders, mine frame.
    contacts : int
        The test ends after this number of robot steps in contact with rock.
    seed : int
    threads : int

    Raises
    ------
    GeometryError
        If the throws do not reach the requested number of contacts, or a simulation step fails.
    """
    robot, task = RobotParams(), dataclasses.replace(TaskParams(), max_forward_mps=_FASTEST_MPS)
    batch = RobotBatch(load_world(bundle), task, robot, _ROBOTS, threads)
    rng = np.random.default_rng(seed)
    height = batch.world.record["height_m"]
    walls = free.boundary
    kinds = _targets(walls, parts, zone_edges_m, rng)
    inside = free.buffer(-robot.radius_m)
    shapely.prepare(inside)
    touched = escapes = throws = 0
    deepest = 0.0
    rngs = [np.random.default_rng([seed, i]) for i in range(_ROBOTS)]
    most = max(20, 20 * contacts // (_ROBOTS * _STEPS))
    shown = progress("stress test", contacts, "contacts")
    for _ in range(most):
        shown.update(min(touched, contacts) - shown.n)
        if touched >= contacts:
            break
        targets = np.concatenate([places[rng.integers(len(places), size=_ROBOTS)] for places in kinds.values()])
        start, towards = _run_ups(targets[rng.permutation(len(targets))], inside, robot.radius_m, rng)
        if not len(start):
            continue
        here = np.arange(min(len(start), _ROBOTS))
        _throw(batch, here, start, towards, rng)
        throws += len(here)
        command = np.column_stack([np.ones(len(here)), rng.uniform(-1, 1, len(here))])
        for _step in range(_STEPS):
            try:
                touched += int(batch.drive(command, rngs, here).sum())
            except RuntimeError as error:
                raise GeometryError(f"stress test: {error}") from error
            out, depth = _escaped(batch, here, free, walls, robot.radius_m, height)
            escapes += int(out.sum())
            deepest = max(deepest, depth)
    batch.close()
    shown.close()
    if touched < contacts:
        raise GeometryError(f"stress test: {throws} throws gave {touched} of {contacts} requested contacts")
    return StressTest(touched, throws, escapes, round(deepest, 5), {name: len(p) for name, p in kinds.items()})


def _targets(
    wall: BaseGeometry, parts: list[np.ndarray], zone_edges_m: list[float], rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """Return target places (n, 2), m, on the walls, by kind."""
    west, south, east, north = wall.bounds
    ends = np.concatenate([shapely.get_coordinates(section_footprint(part)) for part in parts])
    lines = {
        "zone borders": [((x, south - 1), (x, north + 1)) for x in zone_edges_m],
        "tile borders": [
            *(((x, south - 1), (x, north + 1)) for x in np.arange(np.floor(west / TILE_M), east / TILE_M) * TILE_M),
            *(((west - 1, y), (east + 1, y)) for y in np.arange(np.floor(south / TILE_M), north / TILE_M) * TILE_M),
        ],
    }
    kinds = {
        "corners": shapely.get_coordinates(wall),
        # Rounded: neighbours share their corners, but for the last digit, which differs between processors.
        "seams": np.unique(ends[shapely.distance(wall, shapely.points(ends)) < _ON_WALL_M].round(6), axis=0),
        **{
            name: shapely.get_coordinates(shapely.intersection(wall, shapely.multilinestrings(cuts)))
            for name, cuts in lines.items()
            if cuts
        },
        "walls": shapely.get_coordinates(shapely.line_interpolate_point(wall, rng.random(4096), normalized=True)),
    }
    return {name: places for name, places in kinds.items() if len(places)}


def _run_ups(
    targets: np.ndarray, inside: Polygon, radius_m: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return start places near the targets and unit vectors to the targets; starts where no robot fits are dropped."""
    heading = rng.uniform(-np.pi, np.pi, len(targets))
    away = np.array([(math.cos(angle), math.sin(angle)) for angle in heading.tolist()])  # NumPy's differ by processor
    start = targets + away * (radius_m + rng.uniform(*_RUN_UP_M, len(targets)))[:, None]
    fits = shapely.contains_xy(inside, start[:, 0], start[:, 1])
    return start[fits], -away[fits]


def _throw(
    batch: RobotBatch,
    here: np.ndarray,
    start: np.ndarray,
    towards: np.ndarray,
    rng: np.random.Generator,
) -> None:
    """Place robots at their starts, facing roughly the wall, and set their velocity."""
    T = batch.T_world_mine
    speed, spin = rng.uniform(0.5, _FASTEST_MPS, len(here)), rng.uniform(-_SPIN_RADPS, _SPIN_RADPS, len(here))
    yaw = [math.atan2(y, x) for x, y in towards[: len(here)].tolist()] + rng.normal(0, 0.5, len(here))
    for i, k in enumerate(here.tolist()):
        batch.place(k, start[i, 0], start[i, 1], yaw[i])
        along = np.array([[*(speed[i] * towards[i]), 0.0]])
        batch.qvel[k, :3] = rotate_inverse(along, T[:3, :3].T)[0]
        batch.qvel[k, 5] = spin[i]


def _escaped(
    batch: RobotBatch, here: np.ndarray, free: Polygon, walls: BaseGeometry, radius_m: float, height_m: float
) -> tuple[np.ndarray, float]:
    """Return which robots (k,) are out of the workings, and the largest depth of an upright robot's disc in rock, m."""
    T = batch.T_world_mine
    local = rotate_inverse(batch.qpos[here, :3] - T[:3, 3], T[:3, :3])
    place = local
    centre = shapely.points(place[:, :2])
    clearance = np.where(shapely.contains_xy(free, place[:, 0], place[:, 1]), 1, -1) * shapely.distance(walls, centre)
    out = ~np.isfinite(place).all(axis=1) | (clearance < 0) | (place[:, 2] < 0) | (place[:, 2] > height_m)
    x, y = batch.qpos[here, 4], batch.qpos[here, 5]
    mast = np.column_stack(
        [
            2 * (x * batch.qpos[here, 6] + y * batch.qpos[here, 3]),
            2 * (y * batch.qpos[here, 6] - x * batch.qpos[here, 3]),
            1 - 2 * (x * x + y * y),
        ]
    )
    upright = (mast * T[:3, 2]).sum(axis=1) > _UPRIGHT  # a robot on its side is narrower than its disc
    return out, float(np.maximum(0.0, radius_m - clearance)[upright].max(initial=0.0))
