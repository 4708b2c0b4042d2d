"""Physics models of parts of a mine: fewer geoms make a faster step, so a model holds the rock near a robot only."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from minexplore.bundle import (
    MINE_BODY,
    MODEL,
    RECORD,
    ROCK_CLASS,
    BundleError,
    is_floor,
    is_rock,
    is_roof,
)
from minexplore.physics.robot import (
    ROBOT_BIT,
    ROCK_BODY,
    RobotParams,
    contact_sensor,
    separate_contacts,
    stand_on_facets,
)
from minexplore.physics.robot_kind import Robot
from minexplore.rotations import quaternion
from minexplore.task import TaskParams
from minexplore.tiles import Tile, tiles_at
from minexplore.world import World

if TYPE_CHECKING:
    from minexplore.physics.rough_floor import RoughFloor

TILE_M = 2.0
MARGIN_M = 0.1  # beyond the robot's radius and one control step's travel; contacts need none of it
# MuJoCo reserves 13 MB for the contacts of any model, twice a batch: 13 GB of addresses for the 512 batches that are
# kept. Robots thrown at walls use less than 24 kB; 10 kB hold the contacts of a geom at five places.
_CONTACT_BYTES, _CONTACT_BYTES_PER_GEOM = 32 << 10, 10 << 10
ALONE = int(mujoco.mjtDisableBit.mjDSBL_ISLAND)  # what models of one robot switch off: 7 % of a step, no digit
_MOST_GEOMS = 1000  # larger models keep MuJoCo's value


@dataclass(frozen=True)
class RockPart:
    """One convex part: its mesh vertices, place, and outline seen from above (m, mine frame)."""

    name: str
    vertices: np.ndarray
    place: np.ndarray
    outline: np.ndarray


class LocalModels:
    """Physics models of a world, one for all square tiles with the same in reach, of one robot and one state layout."""

    def __init__(self, world: World, task: TaskParams, robot: Robot, whole: bool = False) -> None:
        """Read the world's collision parts; with `whole` every tile's model is that of all parts."""
        self.world, self.task, self.robot, self.whole = world, task, robot, whole
        self.T_world_mine = world.T_world_mine.copy()
        if not task.tilt:
            self.T_world_mine[:3, :3] = np.eye(3)
        self._spec = world.spec()
        self.parts = [_part(self._spec, g) for g in self._spec.geoms if is_rock(g.name)]
        self._rock = _PartIndex(self.parts)
        self._zones = {zone.geom: zone for zone in world.active_zones(task.terrain)}
        self._slabs = [g for g in self._spec.geoms if is_floor(g.name) or is_roof(g.name)]
        absent = sorted(set(self._zones) - {geom.name for geom in self._slabs})
        if absent:
            raise BundleError(f"{world.folder / MODEL}: no geom {absent[0]!r} of a floor zone that {RECORD} names")
        self.rough: RoughFloor | None = None  # of a level floor
        if self._spec.hfields:
            from minexplore.physics.rough_floor import read_rough_floor

            self.rough = read_rough_floor(world, self._spec)
        self._margin_m = robot.radius_m + task.max_forward_mps * task.control_s + MARGIN_M
        self._alike: dict[Tile, Tile] = {}  # the first tile with the same contents
        self._first: dict[tuple[str, ...], Tile] = {}  # by contents

    def tiles_of(self, xy: np.ndarray) -> np.ndarray:
        """Return the tiles (n, 2) whose models places (n, 2) m have: the first like its own; a whole world has one."""
        if self.whole:
            return np.zeros((len(xy), 2), dtype=int)
        tiles = [(x, y) for x, y in tiles_at(xy, TILE_M).tolist()]
        return np.array([self._alike.get(tile) or self._look_at(tile) for tile in tiles], dtype=int).reshape(-1, 2)

    def _look_at(self, tile: Tile) -> Tile:
        """Return the first tile that has the same in reach as a new one."""
        box = self._box(tile)
        slabs = [geom.name for geom in self._slabs if _overlaps(geom, box.low, box.high)]
        rough = self.rough.within(box.low, box.high) if self.rough else []
        floors = [f"{part.name} {part.corner_m} {part.heights_m.shape}" for part in rough]
        contents = *slabs, *floors, *(part.name for part in self._rock.within(box))
        found = self._alike[tile] = self._first.setdefault(contents, tile)
        return found

    def model(self, tile: Tile) -> mujoco.MjModel:
        """Compile the model of a tile: floor, roof, the parts that a robot in it can touch, and the robot.

        Raises
        ------
        BundleError
            If MuJoCo refuses a part; the message is MuJoCo's.
        """
        spec = self.spec(tile)
        if not self.whole:
            step_alone(spec, self.robot)
        return self.world.compile(with_little_memory(spec))

    def spec(self, tile: Tile | None, robots: tuple[str, ...] = ("robot",)) -> mujoco.MjSpec:
        """Return a physics model's spec; without a tile it holds all parts."""
        box = None if tile is None or self.whole else self._box(tile)
        spec = self.rock_spec(box)
        for name in robots:
            self.robot.attach(spec, name)
            if self.rough:
                stand_on_facets(spec, name)
            contact_sensor(spec, name)
        return spec

    def rock_spec(self, box: Box | None) -> mujoco.MjSpec:
        """Return the spec of the parts that reach into a box, without a robot; all of them without a box."""
        spec = physics_spec(self.task)
        mine = spec.worldbody.add_body(name=MINE_BODY, pos=self.T_world_mine[:3, 3])
        mine.quat = quaternion(self.T_world_mine[:3, :3])
        solid = mine.add_body(name=ROCK_BODY)  # one pair test of bodies then rules the rock out for the wheels
        self._add_floor_and_roof(mine, solid, box)
        zones = self.world.active_zones(self.task.terrain)
        tiles = self.rough.within(box.low, box.high) if self.rough and box else self.rough.tiles if self.rough else []
        for tile in tiles:
            tile.add_to(spec, mine, [zones[tile.zone].friction, 0.005, 0.0001])
        rock = self._spec.find_default(ROCK_CLASS).geom
        for part in self.parts if box is None else self._rock.within(box):
            _add_part(spec, solid, part, friction=rock.friction, group=rock.group)
        separate_contacts(spec)
        return spec

    def highest_m(self, place_m: np.ndarray, radius_m: float) -> float:
        """Return how high a rough floor reaches over its planes within a square of the plan; 0 on a level one."""
        return self.rough.highest_m(place_m, radius_m) if self.rough else 0.0

    def _add_floor_and_roof(self, mine: mujoco.MjsBody, solid: mujoco.MjsBody, box: Box | None) -> None:
        """Add the floor zones and the roof that reach into a box; a floor's sliding friction is that of its zone."""
        for geom in self._slabs:
            if box is not None and not _overlaps(geom, box.low, box.high):
                continue
            body, zone = mine if is_floor(geom.name) else solid, self._zones.get(geom.name)
            body.add_geom(
                name=geom.name,
                type=geom.type,
                pos=geom.pos,
                size=geom.size,
                friction=list(geom.friction) if zone is None else [zone.friction, *geom.friction[1:]],
                priority=geom.priority,
                group=geom.group,
            )

    def _box(self, tile: Tile) -> Box:
        """Return the box of the mine frame that holds all that a robot in a tile can touch."""
        return Box(*self.reach(np.array(tile)))

    def reach(self, tile: np.ndarray, size_m: float = TILE_M) -> tuple[np.ndarray, np.ndarray]:
        """Return the south-west and north-east corners (m) of what a robot in a tile can touch in one control step.

        A tile (2,) or many (n, 2), of tiles of this size.
        """
        low = tile * size_m - self._margin_m
        return low, low + size_m + 2 * self._margin_m


@dataclass(frozen=True)
class Box:
    """A box of the mine frame, as high as the mine: its south-west and north-east corners (2,) seen from above, m."""

    low: np.ndarray
    high: np.ndarray


class _PartIndex:
    """Parts by the boxes that hold them."""

    def __init__(self, parts: list[RockPart]) -> None:
        """Take the parts."""
        self.parts = parts
        bounds = np.array([(part.outline.min(axis=0), part.outline.max(axis=0)) for part in parts])
        self._low, self._high = np.moveaxis(bounds.reshape(-1, 2, 2), 1, 0)

    def within(self, box: Box) -> list[RockPart]:
        """Return the parts that may reach into a box."""
        near = ((self._low <= box.high) & (self._high >= box.low)).all(axis=1)
        found = [self.parts[number] for number in np.flatnonzero(near)]
        return [part for part in found if meets(part.outline, box.low[None], box.high[None])[0]]


def with_little_memory(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Return a local model's spec with as much memory as its contacts take; a large one keeps MuJoCo's."""
    geoms = len(spec.geoms)
    if geoms <= _MOST_GEOMS:
        spec.memory = _CONTACT_BYTES + geoms * _CONTACT_BYTES_PER_GEOM
    return spec


def step_alone(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Leave out of a model of one robot what costs time and changes no digit of its motion.

    These are the search for islands, as one robot is one, and the geoms of the chassis that other robots meet or see.
    Wheels keep theirs: MuJoCo looks for a wheel's contacts by the boxes of all its geoms.
    """
    spec.option.disableflags |= ALONE
    if type(robot).attach is RobotParams.attach:  # another robot's sensors may name its geoms
        for geom in list(spec.body("robot").geoms):
            if geom.mass == 0 and not (geom.contype | geom.conaffinity) & ~ROBOT_BIT:
                spec.delete(geom)


def physics_spec(task: TaskParams) -> mujoco.MjSpec:
    """Return an empty spec with the solver's options that all physics of the task has."""
    spec = mujoco.MjSpec()
    spec.option.timestep = task.physics_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # MuJoCo's several contacts of a cylinder at a prism's edge lie along the prism's face, and the edge sinks in:
    # findings/mujoco-cylinder-passes-a-sharp-edge.sh.
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MULTICCD
    return spec


def _overlaps(geom: mujoco.MjsGeom, low: np.ndarray, high: np.ndarray) -> bool:
    """Return whether a box geom reaches into a box of the plan."""
    place, half = np.array(geom.pos)[:2], np.array(geom.size)[:2]
    return bool((place - half <= high).all() and (place + half >= low).all())


def _part(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> RockPart:
    vertices = part_vertices(spec, geom)
    place = np.array(geom.pos)
    return RockPart(geom.name, vertices, place, vertices[:, :2] + place[:2])


def part_vertices(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> np.ndarray:
    """Return the vertices (n, 3) float64 m of the mesh that a spec states for a geom, as they are stated.

    They are counted first: `np.array` looks for their end by an error, which takes 0.1 ms a mesh.
    """
    numbers = spec.mesh(geom.meshname).uservert
    return np.fromiter(numbers, float, len(numbers)).reshape(-1, 3)


def _add_part(spec: mujoco.MjSpec, body: mujoco.MjsBody, part: RockPart, **attributes: Any) -> None:
    spec.add_mesh(name=part.name, uservert=part.vertices.ravel())
    body.add_geom(name=part.name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=part.name, pos=part.place, **attributes)


def meets(outline: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return which boxes (n, 2) to (n, 2) a convex outline (m, 2), in any order, may meet: no edge separates them."""
    apart = (outline.max(axis=0) < low).any(axis=1) | (outline.min(axis=0) > high).any(axis=1)
    if apart.all():
        return ~apart
    centre = outline.mean(axis=0)
    ring = outline[np.argsort(np.arctan2(*(outline - centre).T[::-1]), kind="stable")]
    edges = np.roll(ring, -1, axis=0) - ring
    normals = np.column_stack([edges[:, 1], -edges[:, 0]])
    ours = ring @ normals.T
    corners = [np.where(pick, high, low) @ normals.T for pick in itertools.product((False, True), repeat=2)]
    nearest, farthest = np.minimum.reduce(corners), np.maximum.reduce(corners)
    return ~(apart | ((ours.max(axis=0) < nearest) | (ours.min(axis=0) > farthest)).any(axis=1))
