"""Bodies among the parts: what is thrown at every facet, robots that rest and climb, and steps a second."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from benchmarks.comparisons.volume.proof import Inside
from benchmarks.comparisons.volume.shell import Part
from benchmarks.comparisons.volume.volume import Label, Volume
from minexplore.physics.local_models import LocalModels, physics_spec
from minexplore.physics.robot import (
    FLOOR_BIT,
    ROCK_BIT,
    ROCK_BODY,
    RobotParams,
    attach_robot,
    free_joint_qpos,
    qpos_address,
    stand_on_facets,
)
from minexplore.task import TaskParams
from minexplore.world import load_world

_BALLS = ((0.15, 300.0, 5.0), (0.06, 40.0, 0.5), (0.03, 10.0, 0.1))  # radius m, push N, mass kg
_BALLS_EACH, _ROBOTS = 32, 12
_FEW_PARTS = 50  # among fewer, testing every pair takes less time than MuJoCo's trees of boxes do
_PUSHED, _DRIVEN = 40, 160  # physics steps after a throw
_FASTEST_MPS = 3.0
_SPARE_M, _AHEAD_M = 0.1, 0.7  # beside a robot's disc; a climbing robot needs 0.6 m, as in pipeline.proof.standing
_ASIDE_M, _BELOW_M, _ABOVE_M = 1.6, 0.6, 1.0  # half a tile, the robot's disc and a step's way; a slope; the robot
Progress = Callable[[Iterable[int]], Iterable[int]]


@dataclass(frozen=True)
class Throws:
    """Contacts of the thrown bodies, throws, escapes, and the share of the surface that was a target."""

    contacts: int
    throws: int
    escapes: int
    reached_share: float


def spec_of(
    parts: list[Part], bodies: Callable[[mujoco.MjSpec], None], floor: np.ndarray | None = None
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


def without_refused(parts: list[Part]) -> tuple[list[Part], int]:
    """Return the parts that MuJoCo compiles, and how many it refuses: slivers without a volume."""
    good = []
    for part in parts:
        size = np.linalg.svd(part.corners - part.corners.mean(axis=0), compute_uv=False)
        if size[2] > 1e-6:
            good.append(part)
    return good, len(parts) - len(good)


def _add_balls(spec: mujoco.MjSpec) -> None:
    for kind, (radius, push, mass) in enumerate(_BALLS):
        for number in range(_BALLS_EACH):
            body = spec.worldbody.add_body(name=f"ball_{kind}_{number}", pos=[1e4, 10.0 * number, 1e3 * kind])
            slow = push / _FASTEST_MPS  # a robot's speed: what is faster passes through any wall between two steps
            body.add_joint(type=mujoco.mjtJoint.mjJNT_FREE, damping=[slow, 0, 0])
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0, 0], mass=mass, contype=0, conaffinity=ROCK_BIT
            )


def throw_balls(
    volume: Volume, parts: list[Part], contacts: int, whole: bool, rng: np.random.Generator, progress: Progress = iter
) -> Throws:
    """Push balls at facets in random order, each the largest that fits before it; `whole` goes on until all had one."""
    model = spec_of(parts, _add_balls).compile()
    data, inside = mujoco.MjData(model), Inside(volume)
    normal = volume.normals
    area = np.linalg.norm(normal, axis=1)
    into = -normal / np.maximum(area, 1e-30)[:, None]
    middle = volume.vertices[volume.faces].mean(axis=1)
    radius = np.full(len(middle), -1)
    for kind in range(len(_BALLS) - 1, -1, -1):
        fits = inside.distance_m(middle + into * (_BALLS[kind][0] + 0.01)) > _BALLS[kind][0]
        radius[fits] = kind
    queues = [rng.permutation(np.flatnonzero(radius == kind)) for kind in range(len(_BALLS))]
    at, touched, throws, escapes = [0] * len(queues), 0, 0, 0
    rounds = max(-(-len(queue) // _BALLS_EACH) for queue in queues)
    for turn in progress(range(100 * rounds)):
        if touched >= contacts and (turn >= rounds or not whole):
            break
        mujoco.mj_resetData(model, data)
        thrown: list[int] = []
        for kind, queue in enumerate(queues):
            if not len(queue):
                continue
            if at[kind] + _BALLS_EACH > len(queue):
                queues[kind], at[kind] = rng.permutation(queue), 0
            for number, facet in enumerate(queues[kind][at[kind] : at[kind] + _BALLS_EACH]):
                body = kind * _BALLS_EACH + number
                ball, push, _ = _BALLS[kind]
                data.qpos[7 * body : 7 * body + 3] = middle[facet] + into[facet] * (ball + 0.01)
                way = -into[facet] + 0.7 * rng.standard_normal(3)
                data.xfrc_applied[2 + body, :3] = push * way / np.linalg.norm(way)
                thrown.append(body)
            at[kind] += _BALLS_EACH
        mujoco.mj_forward(model, data)
        for _ in range(_PUSHED):
            mujoco.mj_step(model, data)
            touched += data.ncon
        places = data.qpos.reshape(-1, 7)[thrown, :3]
        gone = inside.distance_m(places) < 0
        escapes += int(gone.sum())
        throws += len(thrown)
    return Throws(touched, throws, escapes, float(area[radius >= 0].sum() / area.sum()))


def _add_robots(count: int) -> Callable[[mujoco.MjSpec], None]:
    def add(spec: mujoco.MjSpec) -> None:
        for number in range(count):
            attach_robot(spec, f"r{number}", RobotParams())
            stand_on_facets(spec, f"r{number}")
            spec.geom(f"r{number}_bumper").contype = spec.geom(f"r{number}_bumper").conaffinity = 0

    return add


def places_for_robots(volume: Volume, ahead_m: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return places (n, 3) m on floors where a robot's disc and mast fit, and the floor's normals (n, 3) there.

    The disc fits also so far ahead, uphill.
    """
    robot, inside = RobotParams(), Inside(volume)
    floor = np.flatnonzero(volume.label == Label.FLOOR)
    normal = -volume.normals[floor]
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    middle = volume.vertices[volume.faces[floor]].mean(axis=1)
    top = robot.sensor_height_m + robot.scanner_height_m / 2
    wide = robot.radius_m + _SPARE_M
    uphill = -normal[:, :2] / np.maximum(np.hypot(*normal[:, :2].T), 1e-9)[:, None]
    rise = np.hypot(*normal[:, :2].T) / np.maximum(normal[:, 2], 1e-9)
    further = middle + ahead_m * np.column_stack([uphill, rise])
    fits = (inside.distance_m(middle + normal * (wide + 0.02)) > wide) & (
        inside.distance_m(further + normal * (wide + 0.02)) > robot.radius_m
    )
    fits &= inside.distance_m(middle + normal * top) > robot.scanner_radius_m
    fits &= normal[:, 2] > np.cos(np.radians(20))
    return middle[fits], normal[fits]


def _stand(data: mujoco.MjData, model: mujoco.MjModel, name: str, place: np.ndarray, up: np.ndarray, yaw: float) -> int:
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


def throw_robots(
    volume: Volume, parts: list[Part], contacts: int, rng: np.random.Generator, progress: Progress = iter
) -> Throws:
    """Throw robots from floors in all directions at up to 3 m/s, and drive them on at full throttle."""
    model = spec_of(parts, _add_robots(_ROBOTS)).compile()
    data, inside, robot = mujoco.MjData(model), Inside(volume), RobotParams()
    places, normals = places_for_robots(volume)
    if not len(places):
        return Throws(0, 0, 0, 0.0)
    touched = throws = escapes = 0
    for _ in progress(range(100 * (1 + contacts // (_ROBOTS * _DRIVEN)))):
        if touched >= contacts:
            break
        mujoco.mj_resetData(model, data)
        body = []
        for number, k in enumerate(rng.integers(len(places), size=_ROBOTS)):
            yaw, name = rng.uniform(-np.pi, np.pi), f"r{number}"
            body.append(_stand(data, model, name, places[k], normals[k], yaw))
            speed = rng.uniform(0, _FASTEST_MPS)
            at = int(model.joint(f"{name}_free").dofadr[0])
            data.qvel[at : at + 2] = speed * np.array([np.cos(yaw), np.sin(yaw)])
            data.ctrl[2 * number : 2 * number + 2] = np.array(robot.wheel_speeds(speed, rng.uniform(-1.5, 1.5)))
        for _step in range(_DRIVEN):
            mujoco.mj_step(model, data)
            touched += data.ncon
        here = np.array([data.qpos[at : at + 3] for at in body])
        escapes += int((inside.distance_m(here) < 0).sum())
        throws += _ROBOTS
    return Throws(touched, throws, escapes, 1.0)


@dataclass(frozen=True)
class Standing:
    """Largest way, m, of robots at rest in 5 s; share that gain height at 0.15 m/s; longest time, s, off both wheels.

    The way is that beyond what their wheels turn, as in `pipeline.proof.standing`.
    """

    rest_m: float
    climb_share: float
    both_off_s: float


def measure_standing(volume: Volume, parts: list[Part], rng: np.random.Generator) -> Standing:
    """Let robots settle for 1 s and rest for 5 s, then drive uphill for 3 s at 0.15 m/s."""
    model = spec_of(parts, _add_robots(_ROBOTS)).compile()
    data, robot = mujoco.MjData(model), RobotParams()
    places, normals = places_for_robots(volume, _AHEAD_M)
    steep = np.flatnonzero(np.hypot(*normals[:, :2].T) > 0.03)
    chosen = rng.choice(steep if len(steep) else np.arange(len(places)), _ROBOTS)
    at = [
        _stand(data, model, f"r{n}", places[k], normals[k], float(np.arctan2(-normals[k, 1], -normals[k, 0])))
        for n, k in enumerate(chosen)
    ]
    here = np.array(at)[:, None] + np.arange(3)
    wheels = np.array([[model.geom(f"r{n}_{side}").id for side in ("left", "right")] for n in range(_ROBOTS)])
    _run(model, data, 1.0)
    before = data.qpos[here].copy()
    _run(model, data, 5.0)
    weight = robot.mass_kg * 9.81 * np.hypot(*normals[chosen, :2].T)
    turned = np.maximum(0, weight * robot.wheel_radius_m / 2 - robot.wheel_friction_nm) / robot.wheel_gain_nms
    rest = np.linalg.norm(data.qpos[here] - before, axis=1) - turned * robot.wheel_radius_m * 5.0
    data.ctrl[:] = np.concatenate([robot.wheel_speeds(0.15, 0.0)] * _ROBOTS)
    before, off, longest = data.qpos[here].copy(), np.zeros(_ROBOTS), np.zeros(_ROBOTS)
    for _ in range(round(3.0 / model.opt.timestep)):
        mujoco.mj_step(model, data)
        touching = np.isin(wheels, data.contact.geom).any(axis=1)
        off = np.where(touching, 0.0, off + model.opt.timestep)
        longest = np.maximum(longest, off)
    gained = data.qpos[here][:, 2] - before[:, 2] > 0
    return Standing(float(rest.max(initial=0.0)), float(gained.mean()), float(longest.max()))


def _run(model: mujoco.MjModel, data: mujoco.MjData, time_s: float) -> None:
    mujoco.mj_step(model, data, round(time_s / model.opt.timestep))


def local_parts(parts: list[Part], place: np.ndarray) -> list[Part]:
    """Return the parts that a robot in a tile of 2 m about a place can touch in a control step, by their boxes."""
    low, high = place - [_ASIDE_M, _ASIDE_M, _BELOW_M], place + [_ASIDE_M, _ASIDE_M, _ABOVE_M]
    return [p for p in parts if (p.corners.min(axis=0) < high).all() and (p.corners.max(axis=0) > low).all()]


class Driver:
    """A robot that drives in small circles about a place of its model; `rate` times it."""

    def __init__(self, model: mujoco.MjModel, place: Callable[[mujoco.MjData], None]) -> None:
        """Take a model with one robot and what puts it at its start."""
        self._model, self._place, self._data = model, place, mujoco.MjData(model)

    def rate(self, seed: int, steps: int = 1000) -> float:
        """Return the physics steps a second."""
        rng = np.random.default_rng(seed)
        mujoco.mj_resetData(self._model, self._data)
        self._place(self._data)
        _run(self._model, self._data, 0.5)
        start = time.process_time()
        for _ in range(steps // 20):
            self._data.ctrl[:] = RobotParams().wheel_speeds(rng.uniform(0.1, 0.4), rng.choice([-1.5, 1.5]))
            mujoco.mj_step(self._model, self._data, 20)
        return steps / (time.process_time() - start)


def drivers(volume: Volume, parts: list[Part], rng: np.random.Generator) -> tuple[dict[str, Driver], int]:
    """Return a robot among all parts and one among those within its reach, at one random place, and how many these are.

    The place is the one with the median number of parts among nine.
    """
    places, normals = places_for_robots(volume)
    some = rng.integers(len(places), size=9)
    chosen = sorted(((local_parts(parts, places[k]), int(k)) for k in some), key=lambda pair: len(pair[0]))
    near, k = chosen[len(chosen) // 2]
    found: dict[str, Driver] = {}
    for name, rock in (("all", parts), ("local", near)):
        spec = spec_of(rock, _add_robots(1), volume.label == Label.FLOOR if name == "local" else None)
        if name == "local" and len(rock) <= _FEW_PARTS:
            spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
        model = spec.compile()

        def place(data: mujoco.MjData, model: mujoco.MjModel = model) -> None:
            _stand(data, model, "r0", places[k], normals[k], 0.0)

        found[name] = Driver(model, place)
    return found, len(near)


def world_driver(bundle: Path) -> Driver:
    """Return a robot at the start of a world that the pipeline built, in the environment's local model there."""
    world, robot = load_world(bundle), RobotParams()
    models = LocalModels(world, TaskParams(), robot)
    x, y = (float(v) for v in world.record["spawn"]["anchor_m"][:2])
    tile = tuple(int(v) for v in models.tiles_of(np.array([[x, y]]))[0])
    model = models.model(tile)  # type: ignore[arg-type]
    at = qpos_address(model, "robot")[:7]

    def place(data: mujoco.MjData) -> None:
        data.qpos[at] = free_joint_qpos(models.T_world_mine, robot, x, y, 0.0, world.floor)

    return Driver(model, place)
