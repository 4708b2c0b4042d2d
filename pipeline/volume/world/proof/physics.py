"""A model of the parts with robots in it: where they fit, how they rest and climb."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from minexplore.floors.volume_arrays import FacetLabel
from minexplore.physics.local_models import physics_spec
from minexplore.physics.robot import (
    FLOOR_BIT,
    ROCK_BIT,
    ROCK_BODY,
    RobotParams,
    attach_robot,
    stand_on_facets,
)
from minexplore.physics.robot_kind import keep_in_disc
from minexplore.task import TaskParams
from pipeline.volume.height_field.leg_lines import drop
from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Volume

ROBOTS = 12
# Rise over run. On an even plane of 0.2 the robot creeps by up to 18 mm in 5 s, of 0.25 by 27, of 0.35 by 54: its
# wheels turn under its weight, and its castors bear some of it and have no friction. On steeper floors it slides.
STEEPEST = 0.2
STEEPEST_UP = np.cos(np.radians(20))  # of the normal of a floor on which robots are put
_PLANE_M, _APART_M = 3.0, 10.0  # half a side of an even plane, and between two
_SPARE_M, _AHEAD_M = 0.1, 0.7  # beside a robot's disc; a climbing robot needs 0.6 m
_STEP_M, _STEPS, _RING = 0.2, 4, 8  # a robot's length about a place, where its wheels and castors come to
_OVER_M = 0.3  # from which the floor about a place is looked for


def spec_of(
    parts: list[ShellPart], bodies: Callable[[mujoco.MjSpec], None], floor: np.ndarray | None = None
) -> mujoco.MjSpec:
    """Return a model of parts, each a mesh in one static body, and of what `bodies` adds.

    Every part stops everything; those of `floor`, a mask of facets, stop wheels and castors alone, as today's floors.
    """
    spec = physics_spec(TaskParams())
    rock = spec.worldbody.add_body(name=ROCK_BODY)
    for number, part in enumerate(parts):
        bits = FLOOR_BIT if floor is not None and floor[part.facets[0]] else ROCK_BIT | FLOOR_BIT
        middle = part.corners.mean(axis=0)
        mesh = spec.add_mesh(name=f"part_{number}", uservert=(part.corners - middle).ravel().tolist())
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        rock.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"part_{number}", pos=middle, contype=bits, conaffinity=0
        )
    bodies(spec)
    return spec


def add_robots(count: int) -> Callable[[mujoco.MjSpec], None]:
    """Return what adds robots that do not touch each other to a model."""

    def add(spec: mujoco.MjSpec) -> None:
        robot = RobotParams()
        for number in range(count):
            attach_robot(spec, f"r{number}", robot)
            stand_on_facets(spec, f"r{number}")
            for wheel in itertools.chain(*robot.SIDES):
                keep_in_disc(spec.geom(f"r{number}_{wheel}"), robot.radius_m)
            spec.geom(f"r{number}_bumper").contype = spec.geom(f"r{number}_bumper").conaffinity = 0

    return add


def places_for_robots(
    volume: Volume, ahead_m: float = 0.0, targets: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return places (n, 3) m on floors where a robot's disc and mast fit, and the floor's normals (n, 3) there.

    The disc fits also so far ahead, uphill. `targets` (f,) says which facets count; None is all.
    """
    robot, inside = RobotParams(), volume.inside
    floor = np.flatnonzero((volume.label == FacetLabel.FLOOR) & (True if targets is None else targets))
    normal = -volume.normals[floor]
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    middle = volume.vertices[volume.faces[floor]].mean(axis=1)
    top = robot.sensor_height_m + robot.scanner_height_m / 2
    wide = robot.radius_m + _SPARE_M
    uphill = -normal[:, :2] / np.maximum(np.hypot(*normal[:, :2].T), 1e-9)[:, None]
    rise = np.hypot(*normal[:, :2].T) / np.maximum(normal[:, 2], 1e-9)
    further = middle + ahead_m * np.column_stack([uphill, rise])
    disc = normal * (wide + 0.02)
    fits = np.flatnonzero(normal[:, 2] > STEEPEST_UP)
    for places, free_m in (
        (middle + disc, wide),
        (further + disc, robot.radius_m),
        (middle + normal * top, robot.scanner_radius_m),
    ):
        fits = fits[inside.are_farther(places[fits], free_m)]
    return middle[fits], normal[fits]


def stand(data: mujoco.MjData, model: mujoco.MjModel, name: str, place: np.ndarray, up: np.ndarray, yaw: float) -> int:
    """Put a robot on a place of the floor; return the address of its free joint."""
    ahead = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    ahead -= up * (ahead @ up)
    ahead /= np.linalg.norm(ahead)
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.column_stack([ahead, np.cross(up, ahead), up]).ravel())
    at = int(model.joint(f"{name}_free").qposadr[0])
    data.qpos[at : at + 3] = place + up * RobotParams().wheel_radius_m
    data.qpos[at + 3 : at + 7] = quat
    return at


@dataclass(frozen=True)
class RobotsAtRest:
    """Largest way, m, of robots at rest in 5 s; share that gain height at 0.15 m/s; longest time, s, off both wheels.

    The way is that beyond the way on an even plane as steep (`creep_on_planes`). `rest_at` is the number of the robot
    that moved farthest and where it stood, m; None if none was judged.
    """

    rest_m: float
    climb_share: float
    both_off_s: float
    rest_at: tuple[int, tuple[float, float, float]] | None = None


def measure_standing(
    volume: Volume, parts: list[ShellPart], rng: np.random.Generator, targets: np.ndarray | None = None
) -> RobotsAtRest:
    """Let robots settle for 1 s and rest for 5 s, then drive uphill for 3 s at 0.15 m/s.

    `targets` (f,) says on which floors; None is all. Floors that rise or fall by more than `STEEPEST` within a robot's
    length are left out: on steeper ones robots creep on an even plane too, and beside an edge they fall. Where no robot
    fits, none moves and none climbs.
    """
    places, normals = places_for_robots(volume, _AHEAD_M, targets)
    even = _is_even(volume, places)
    places, normals = places[even], normals[even]
    if not len(places):
        return RobotsAtRest(0.0, 0.0, 0.0)
    model = spec_of(parts, add_robots(ROBOTS)).compile()
    data, robot = mujoco.MjData(model), RobotParams()
    steep = np.flatnonzero(np.hypot(*normals[:, :2].T) > 0.03)
    chosen = rng.choice(steep if len(steep) else np.arange(len(places)), ROBOTS)
    at = [
        stand(data, model, f"r{n}", places[k], normals[k], float(np.arctan2(-normals[k, 1], -normals[k, 0])))
        for n, k in enumerate(chosen)
    ]
    here = np.array(at)[:, None] + np.arange(3)
    wheels = np.array([[model.geom(f"r{n}_{side}").id for side in ("left", "right")] for n in range(ROBOTS)])
    run_for(model, data, 1.0)
    axes = np.array([data.body(f"r{n}").xmat.reshape(3, 3) for n in range(ROBOTS)])
    rest = _way_at_rest_m(model, data, here) - creep_on_planes(axes)
    data.ctrl[:] = np.array(robot.wheel_speeds(np.full(ROBOTS, 0.15), np.zeros(ROBOTS))).T.ravel()
    before, off, longest = data.qpos[here].copy(), np.zeros(ROBOTS), np.zeros(ROBOTS)
    for _ in range(round(3.0 / model.opt.timestep)):
        mujoco.mj_step(model, data)
        touching = np.isin(wheels, data.contact.geom).any(axis=1)
        off = np.where(touching, 0.0, off + model.opt.timestep)
        longest = np.maximum(longest, off)
    gained = data.qpos[here][:, 2] - before[:, 2] > 0
    farthest = int(rest.argmax())
    x, y, z = places[chosen[farthest]].tolist()
    return RobotsAtRest(
        max(0.0, float(rest[farthest])), float(gained.mean()), float(longest.max()), (farthest, (x, y, z))
    )


def creep_on_planes(axes: np.ndarray) -> np.ndarray:
    """Return how far (n,) m robots that stand as stated creep in 5 s at rest on even planes, after 1 s to settle.

    `axes` (n, 3, 3) has the ways ahead, left and up of each robot in its columns. Planes are at most `STEEPEST`.
    """
    ups = axes[:, :, 2] * [1, 1, 0]
    rise = np.linalg.norm(ups, axis=1) / np.maximum(axes[:, 2, 2], 1e-9)
    ups *= np.minimum(1, STEEPEST / np.maximum(rise, 1e-9))[:, None]
    ups[:, 2] = axes[:, 2, 2]
    ups /= np.linalg.norm(ups, axis=1, keepdims=True)
    yaw = np.arctan2(axes[:, 1, 0], axes[:, 0, 0])
    places = _APART_M * np.outer(np.arange(len(axes)), [1, 0, 0])
    spec = physics_spec(TaskParams())
    for place, up in zip(places, ups, strict=True):
        turn = np.zeros(4)
        mujoco.mju_quatZ2Vec(turn, up)
        size = [_PLANE_M, _PLANE_M, _SPARE_M]
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=size,
            pos=place - _SPARE_M * up,
            quat=turn,
            contype=FLOOR_BIT,
            conaffinity=0,
        )
    add_robots(len(axes))(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    at = [stand(data, model, f"r{n}", places[n], ups[n], yaw[n]) for n in range(len(axes))]
    run_for(model, data, 1.0)
    return _way_at_rest_m(model, data, np.array(at)[:, None] + np.arange(3))


def _way_at_rest_m(model: mujoco.MjModel, data: mujoco.MjData, here: np.ndarray) -> np.ndarray:
    """Let robots rest for 5 s; return how far (n,) m each moves, whose places in `qpos` are `here` (n, 3)."""
    before = data.qpos[here].copy()
    run_for(model, data, 5.0)
    found: np.ndarray = np.linalg.norm(data.qpos[here] - before, axis=1)
    return found


def _is_even(volume: Volume, places: np.ndarray) -> np.ndarray:
    """Return at which places (n, 3) m the floor is nowhere steeper than `STEEPEST` about a robot.

    Heights are compared step by step on the way from the place outwards, in eight directions, as far as it is free.
    """
    angle = np.arange(_RING) * (2 * np.pi / _RING)
    far = np.arange(_STEPS + 1) * _STEP_M
    ring = np.stack([np.outer(far, np.cos(angle)), np.outer(far, np.sin(angle)), np.full((len(far), _RING), _OVER_M)])
    beside = (places[:, None, None] + np.moveaxis(ring, 0, -1)).reshape(-1, 3)
    shape = (len(places), len(far), _RING)
    free = volume.inside.rays_say_free(beside).reshape(shape)
    rise = np.abs(np.diff(drop(volume.vertices, volume.faces, beside)[1].reshape(shape), axis=1))
    return np.asarray((~(free[:, 1:] & free[:, :-1]) | (rise <= STEEPEST * _STEP_M)).all(axis=(1, 2)))


def run_for(model: mujoco.MjModel, data: mujoco.MjData, time_s: float) -> None:
    """Step a model for a time, s."""
    mujoco.mj_step(model, data, round(time_s / model.opt.timestep))
