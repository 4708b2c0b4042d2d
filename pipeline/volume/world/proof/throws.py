"""What is thrown and pushed at the parts: balls at every facet, robots at walls that stand on floors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from minexplore.floors.volume_arrays import FacetLabel
from minexplore.physics.robot import ROCK_BIT, ROCK_BODY, RobotParams
from pipeline.volume.height_field.leg_lines import drop
from pipeline.volume.rock.ragged import parts_of
from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Volume
from pipeline.volume.world.proof.physics import ROBOTS, STEEPEST_UP, add_robots, spec_of, stand
from pipeline.volume.world.proof.region import parts_about

_BALLS = ((0.15, 300.0, 5.0), (0.06, 40.0, 0.5), (0.03, 10.0, 0.1))  # radius m, push N, mass kg
_BALLS_EACH = 32
_PUSHED, _DRIVEN, _LOOKED = 40, 160, 20  # physics steps after a throw; between two looks at where robots are
_SLOWEST_MPS, _FASTEST_MPS, _TURN_RADPS = 0.5, 3.0, 1.5
_OFF_RAD = 0.5  # of a robot's heading from its way to the wall
_RUN_UP_M = (0.05, 0.6)  # between a robot's disc and the place that it is thrown at, as of level worlds
_DRAWN = 4096  # places of walls, beside all their corners
_OVER_M, _SPARE_M = 0.3, 0.02  # from corners to where they are thrown at; between a floor and a ball of the disc's size
_REACH_M = np.array([2.8, 2.8, 3.5])  # of a thrown robot's edge in 0.8 s: 2.4 m at 3 m/s, and 3.1 m as it falls
_MOST = 20  # steps of robots for each contact
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


@dataclass(frozen=True)
class RunUps:
    """Where robots stand before they are thrown.

    Attributes
    ----------
    places_m, ups : (n, 3) float64
        Places on floors, m, and the floors' normals there.
    towards : (n, 2) float64
        Unit vectors, seen from above, to the places of walls that they are thrown at.
    facets : (n,) int64
        The facets of these walls.
    """

    places_m: np.ndarray
    ups: np.ndarray
    towards: np.ndarray
    facets: np.ndarray

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.facets)

    def some(self, rows: np.ndarray) -> RunUps:
        """Return those of some rows."""
        return RunUps(self.places_m[rows], self.ups[rows], self.towards[rows], self.facets[rows])


def run_ups(volume: Volume, rng: np.random.Generator, targets: np.ndarray | None = None) -> RunUps:
    """Return places on floors where a robot fits, each before a corner of a wall or before a place drawn by area.

    `targets` (f,) says which facets count; None is all.
    """
    wall = np.flatnonzero((volume.label == FacetLabel.WALL) & (True if targets is None else targets))
    area = np.linalg.norm(volume.normals[wall], axis=1)
    if not area.any():
        return RunUps(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 2)), np.zeros(0, int))
    corners, facet = np.unique(volume.faces[wall], return_index=True)
    drawn = rng.choice(len(wall), _DRAWN, p=area / area.sum())
    on_walls = np.einsum("ki,kij->kj", rng.dirichlet(np.ones(3), _DRAWN), volume.vertices[volume.faces[wall[drawn]]])
    place = np.concatenate([volume.vertices[corners] + [0, 0, _OVER_M], on_walls])
    facet, robot, inside = wall[np.concatenate([facet // 3, drawn])], RobotParams(), volume.inside
    heading, run_up = rng.uniform(-np.pi, np.pi, len(place)), rng.uniform(*_RUN_UP_M, len(place))
    towards = np.column_stack([np.cos(heading), np.sin(heading)])
    place[:, :2] -= towards * (robot.radius_m + run_up)[:, None]
    free = inside.rays_say_free(place)
    place, towards, facet = place[free], towards[free], facet[free]
    floor, height = drop(volume.vertices, volume.faces, place)
    up = -volume.normals[floor]
    up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-30)
    stands = (floor >= 0) & (volume.label[floor] == FacetLabel.FLOOR) & (up[:, 2] > STEEPEST_UP)
    place[:, 2] = height
    found = RunUps(place, up, towards, facet).some(stands)
    disc = found.places_m + found.ups * (robot.radius_m + _SPARE_M)
    return found.some(inside.are_farther(disc, robot.radius_m))


def throw_robots(
    volume: Volume,
    parts: list[ShellPart],
    contacts: int,
    rng: np.random.Generator,
    targets: np.ndarray | None = None,
) -> Throws:
    """Throw robots at walls at up to 3 m/s and drive them on at full throttle until they had contacts with rock.

    Twelve are thrown at once, each at a place of its own, among the parts about these places. A robot whose chassis
    touches a part that is not behind a floor has one contact in each tenth of a second, as a step of the environment
    has; wheels, castors and floors do not count. The throws end without the contacts when twenty times as many steps
    had none. `targets` (f,) says which facets are thrown at; None is all.
    """
    starts, found = run_ups(volume, rng, targets), Throws()
    if not len(starts):
        return found
    boxes = parts_of([part.corners for part in parts]).boxes_m
    is_rock = np.array([volume.label[part.facets[0]] != FacetLabel.FLOOR for part in parts])
    begun = [np.zeros(0, int)]
    for _ in range(_MOST * max(1, contacts // (ROBOTS * _DRIVEN // _LOOKED))):
        if found.contacts >= contacts:
            break
        some = starts.some(rng.integers(len(starts), size=ROBOTS))
        begun.append(some.facets)
        near = parts_about(boxes, some.places_m[:, None], _REACH_M)
        found += _throw_at_once(volume, [parts[k] for k in near], is_rock[near], some, rng)
    return replace(found, facets=len(np.unique(np.concatenate(begun))))


def _throw_at_once(
    volume: Volume, parts: list[ShellPart], is_rock: np.ndarray, starts: RunUps, rng: np.random.Generator
) -> Throws:
    """Throw a robot from each start (n,) among parts (p,), of which some are rock."""
    model, count = spec_of(parts, add_robots(len(starts))).compile(), len(starts)
    data, inside, robot = mujoco.MjData(model), volume.inside, RobotParams()
    yaw = np.arctan2(*starts.towards[:, ::-1].T) + rng.normal(0, _OFF_RAD, count)
    speed, turn = rng.uniform(_SLOWEST_MPS, _FASTEST_MPS, count), rng.uniform(-_TURN_RADPS, _TURN_RADPS, count)
    at = [stand(data, model, f"r{n}", starts.places_m[n], starts.ups[n], float(yaw[n])) for n in range(count)]
    for n in range(count):
        dof = int(model.joint(f"r{n}_free").dofadr[0])
        data.qvel[dof : dof + 2] = speed[n] * starts.towards[n]
    data.ctrl[:] = np.array(robot.wheel_speeds(np.full(count, _FASTEST_MPS), turn)).T.ravel()
    discs = [data.geom(f"r{n}_chassis") for n in range(count)]
    robot_of, rock = np.full(model.ngeom, -1), np.zeros(model.ngeom, bool)
    robot_of[[disc.id for disc in discs]] = np.arange(count)
    first = int(model.body(ROCK_BODY).geomadr[0])
    rock[first : first + len(parts)] = is_rock
    found = Throws(throws=count)
    for _ in range(_DRIVEN // _LOOKED):
        touched = np.zeros(count, bool)
        for _ in range(_LOOKED):
            mujoco.mj_step(model, data)
            pairs = data.contact.geom
            for one, other in (pairs.T, pairs.T[::-1]):
                touched[robot_of[one[rock[other]]]] |= robot_of[one[rock[other]]] >= 0
        here = data.qpos[np.array(at)[:, None] + np.arange(3)]
        middles = np.array([disc.xpos for disc in discs])
        deepest = deepest_disc(volume, middles, np.array([disc.xmat.reshape(3, 3) for disc in discs]))
        found += replace(deepest, contacts=int(touched.sum()), escapes=int(inside.are_in_rock(here).sum()))
    return found


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
