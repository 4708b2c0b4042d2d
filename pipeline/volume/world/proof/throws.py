"""What is thrown and pushed at the parts: balls at every facet, robots from every floor."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from minexplore.physics.robot import ROCK_BIT, RobotParams
from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Volume
from pipeline.volume.world.proof.physics import ROBOTS, add_robots, places_for_robots, spec_of, stand

_BALLS = ((0.15, 300.0, 5.0), (0.06, 40.0, 0.5), (0.03, 10.0, 0.1))  # radius m, push N, mass kg
_BALLS_EACH = 32
_PUSHED, _DRIVEN, _LOOKED = 40, 160, 20  # physics steps after a throw; between two looks at where robots are
_FASTEST_MPS = 3.0
_RAYS = 64  # from a disc's middle outwards: 3 cm apart at its rim


@dataclass(frozen=True)
class Throws:
    """Contacts of the thrown bodies, throws, escapes, and how many facets bodies began before.

    `deepest_m` is how far rock reached into the disc of a robot, and `deepest_at` where that disc's middle was, m.
    """

    contacts: int = 0
    throws: int = 0
    escapes: int = 0
    facets: int = 0
    deepest_m: float = 0.0
    deepest_at: tuple[float, float, float] | None = None

    def __add__(self, other: Throws) -> Throws:
        """Return these and others, which began before other facets."""
        deeper = max(self, other, key=lambda one: one.deepest_m)
        return Throws(
            self.contacts + other.contacts,
            self.throws + other.throws,
            self.escapes + other.escapes,
            self.facets + other.facets,
            deeper.deepest_m,
            deeper.deepest_at,
        )


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
    volume: Volume,
    parts: list[ShellPart],
    contacts: int,
    whole: bool,
    rng: np.random.Generator,
    targets: np.ndarray | None = None,
) -> Throws:
    """Push balls at facets in random order, each the largest that fits before it; `whole` goes on until all had one.

    `targets` (f,) says which facets are pushed at; None is all.
    """
    model = spec_of(parts, _add_balls).compile()
    data, inside = mujoco.MjData(model), volume.inside
    normal = volume.normals
    area = np.linalg.norm(normal, axis=1)
    into = -normal / np.maximum(area, 1e-30)[:, None]
    middle = volume.vertices[volume.faces].mean(axis=1)
    radius, asked = np.full(len(middle), -1), np.flatnonzero(np.ones(len(middle), bool) if targets is None else targets)
    for kind in range(len(_BALLS) - 1, -1, -1):
        fits = inside.are_farther(middle[asked] + into[asked] * (_BALLS[kind][0] + 0.01), _BALLS[kind][0])
        radius[asked[fits]] = kind
    queues = [_Facets(np.flatnonzero(radius == kind), rng) for kind in range(len(_BALLS))]
    touched, throws, escapes = 0, 0, 0
    rounds = max(queue.rounds for queue in queues)
    for turn in range(100 * rounds):
        if touched >= contacts and (turn >= rounds or not whole):
            break
        mujoco.mj_resetData(model, data)
        thrown: list[int] = []
        for kind, queue in enumerate(queues):
            for number, facet in enumerate(queue.next()):
                body = kind * _BALLS_EACH + number
                ball, push, _ = _BALLS[kind]
                data.qpos[7 * body : 7 * body + 3] = middle[facet] + into[facet] * (ball + 0.01)
                way = -into[facet] + 0.7 * rng.standard_normal(3)
                data.xfrc_applied[2 + body, :3] = push * way / np.linalg.norm(way)
                thrown.append(body)
        mujoco.mj_forward(model, data)
        for _ in range(_PUSHED):
            mujoco.mj_step(model, data)
            touched += data.ncon
        places = data.qpos.reshape(-1, 7)[thrown, :3]
        escapes += int(inside.are_in_rock(places).sum())
        throws += len(thrown)
    return Throws(touched, throws, escapes, sum(queue.seen for queue in queues))


class _Facets:
    """Facets in random order, as many at once as there are balls of a kind; each comes once before one comes again."""

    def __init__(self, facets: np.ndarray, rng: np.random.Generator) -> None:
        """Take facets (n,)."""
        self._order, self._rng, self._at = rng.permutation(facets), rng, 0
        self.rounds, self.seen = -(-len(facets) // _BALLS_EACH), 0

    def next(self) -> np.ndarray:
        """Return the next facets (n,)."""
        if self._at >= len(self._order):
            self._order, self._at = self._rng.permutation(self._order), 0
        self._at += _BALLS_EACH
        found: np.ndarray = self._order[self._at - _BALLS_EACH : self._at]
        self.seen = min(self.seen + len(found), len(self._order))
        return found


def throw_robots(
    volume: Volume,
    parts: list[ShellPart],
    contacts: int,
    rng: np.random.Generator,
    targets: np.ndarray | None = None,
) -> Throws:
    """Throw robots from floors in all directions at up to 3 m/s, and drive them on at full throttle.

    `targets` (f,) says which floors they are thrown from; None is all.
    """
    model = spec_of(parts, add_robots(ROBOTS)).compile()
    data, inside, robot = mujoco.MjData(model), volume.inside, RobotParams()
    places, normals = places_for_robots(volume, targets=targets)
    if not len(places):
        return Throws()
    discs = [data.geom(f"r{number}_chassis") for number in range(ROBOTS)]
    touched, begun, escapes, deepest = 0, [np.zeros(0, int)], 0, Throws()
    for _ in range(100 * (1 + contacts // (ROBOTS * _DRIVEN))):
        if touched >= contacts:
            break
        mujoco.mj_resetData(model, data)
        body = []
        begun.append(rng.integers(len(places), size=ROBOTS))
        for number, k in enumerate(begun[-1]):
            yaw, name = rng.uniform(-np.pi, np.pi), f"r{number}"
            body.append(stand(data, model, name, places[k], normals[k], yaw))
            speed = rng.uniform(0, _FASTEST_MPS)
            at = int(model.joint(f"{name}_free").dofadr[0])
            data.qvel[at : at + 2] = speed * np.array([np.cos(yaw), np.sin(yaw)])
            data.ctrl[2 * number : 2 * number + 2] = np.array(
                robot.wheel_speeds(np.array([speed]), rng.uniform(-1.5, 1.5, 1))
            ).ravel()
        for step in range(1, _DRIVEN + 1):
            mujoco.mj_step(model, data)
            touched += data.ncon
            if step % _LOOKED:
                continue
            here = np.array([data.qpos[at : at + 3] for at in body])
            escapes += int(inside.are_in_rock(here).sum())
            middles = np.array([disc.xpos for disc in discs])
            deepest += deepest_disc(volume, middles, np.array([disc.xmat.reshape(3, 3) for disc in discs]))
    found = Throws(touched, ROBOTS * (len(begun) - 1), escapes, len(np.unique(np.concatenate(begun))))
    return found + deepest


def deepest_disc(volume: Volume, middles: np.ndarray, axes: np.ndarray) -> Throws:
    """Return how far rock reaches into the discs of robots, by rays from their middles to the surface.

    Parameters
    ----------
    volume : Volume
    middles : (n, 3) float64, m
        The middles of the discs.
    axes : (n, 3, 3) float64
        The ways ahead, left and up of each robot in its columns.
    """
    angle = np.arange(_RAYS) * (2 * np.pi / _RAYS)
    ways = np.cos(angle)[:, None] * axes[:, None, :, 0] + np.sin(angle)[:, None] * axes[:, None, :, 1]
    starts = np.broadcast_to(middles[:, None], ways.shape).reshape(-1, 3)
    free_m = volume.inside.ways_m(starts, ways.reshape(-1, 3)).reshape(len(middles), _RAYS).min(axis=1)
    number = int(free_m.argmin())
    x, y, z = middles[number].tolist()
    return Throws(deepest_m=max(0.0, RobotParams().radius_m - float(free_m[number])), deepest_at=(x, y, z))
