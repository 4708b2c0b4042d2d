"""Local models of a volume: walls in reach, and a plane under each foot where the floor is flat for a control step."""

from __future__ import annotations

import math
from collections.abc import Iterator

import mujoco
import numpy as np

from minexplore.bundle import MINE_BODY
from minexplore.physics.local_models import MARGIN_M, physics_spec, with_little_memory
from minexplore.physics.robot import (
    FASTEST_FALL_MPS,
    FLOOR_BIT,
    ROBOT_BIT,
    ROCK_BIT,
    ROCK_BODY,
    RobotParams,
    contact_sensor,
    stand_on_facets,
)
from minexplore.physics.robot_kind import Robot, keep_in_disc
from minexplore.task import TaskParams
from minexplore.tiles import Tile
from minexplore.volume.flat import FlatFloors, FlatTile
from minexplore.volume.rock import add_part, bits_of
from minexplore.world import World

TILE_M, EXACT_TILE_M = (2.0, 1.0), (1.0, 0.5)  # width and height of a tile: with half of each, more models are made
_BAND_M = (-0.3, 0.45)  # of the chassis about the axle's height in one control step, leaning by 25 deg
_ABOVE_M = 0.25  # beyond a robot's radius: what it can touch over its axle in one control step, in any position
_GRAVITY_MPS2 = 9.81
FEET = ("left", "right", "front", "rear")
_FOOT_BITS = (8, 16, 32, 64)
_HALF_M = (0.5, 0.5, 0.25)  # of a box whose top is a plane; it reaches beyond the plane's disc
PARKED_M = np.array([[1e4 * (1 + k), 0.0, -1e4] for k in range(len(FEET))])  # places of unused boxes
_ZONE_BITS = 10  # of a wheel's zone in a model's code: a world has at most 1,000
_WHOLE, NONE = -1, -2  # numbers of the tile that is the whole mine, and of none


def code_of(on_parts: np.ndarray, zones: np.ndarray) -> np.ndarray:
    """Return the codes (n,) of models: a bit for each foot that touches the floor's parts, and both wheels' zones.

    A wheel has the friction of the zone that it is in when a control step begins, whatever it touches. So a floor has
    no other friction at a border of two zones, wherever its parts end.
    """
    found: np.ndarray = on_parts | zones[:, 0] << len(FEET) | zones[:, 1] << (len(FEET) + _ZONE_BITS)
    return found


class VolumeModels:
    """Physics models of a volume, as `PhysicsStepper` takes them, each with one robot and the same state layout.

    A model is that of a tile, a box of the mine frame, and of which feet touch the floor's parts. The other feet stand
    on a box each, which the state moves; then the model has only the walls that the chassis can reach. Where the floor
    is one plane, all feet stand on one box that stays, and the model has all rock in reach but the floor. If all floors
    of the mine are one level plane, robots are the same as on a level plan.
    """

    def __init__(
        self,
        world: World,
        task: TaskParams,
        robot: Robot,
        whole: bool = False,
        exact_tile_m: tuple[float, float] | None = None,
    ) -> None:
        """Take a world's parts; with `whole` every model is that of all parts.

        `exact_tile_m` is the width and the height of the tiles of models in which feet touch the floor's parts, if not
        `EXACT_TILE_M`.
        """
        assert world.volume is not None
        self.world, self.task, self.robot, self.whole = world, task, robot, whole
        self.T_world_mine = world.T_world_mine
        self._floors = FlatFloors(world.volume.facets)
        self.is_level = not whole and self._floors.level is not None
        # Another robot has other feet.
        self.has_planes = not whole and not self.is_level and type(robot).attach is RobotParams.attach
        self._parts = world.volume.parts
        self._low, self._high = (np.ascontiguousarray(side.T) for side in self._parts.boxes_m)
        self._bits = bits_of(self._parts)
        self._zones = world.active_zones(task.terrain)
        exact_tile_m = exact_tile_m or (EXACT_TILE_M if self.has_planes else TILE_M)
        self._sides = {False: (TILE_M[0], *TILE_M), True: (exact_tile_m[0], *exact_tile_m)}
        self._number: dict[bool, dict[tuple[int, int, int], int]] = {False: {}, True: {}}
        self._boxes: list[tuple[np.ndarray, np.ndarray]] = []
        self._flat: dict[int, FlatTile] = {}  # by number
        self._alike: dict[tuple[int, ...], int] = {}  # of a level mine: the first tile, by number, with these parts
        self._flat_choice: dict[tuple[int, ...], tuple[int, int]] = {}  # see `flat_tiles`

    def tiles_of(self, chosen: np.ndarray) -> np.ndarray:
        """Return the models (n, 2) that were chosen: the number of a tile, and a code, see `code_of`."""
        return chosen

    def numbers_of(self, places_m: np.ndarray, is_exact: np.ndarray) -> np.ndarray:
        """Return the numbers (n,) of the tiles that places (n, 3) m, mine frame, are in; a whole mine has one.

        `is_exact` (n,) says in which the floor's parts count: these tiles are of another size.
        """
        if self.whole:
            return np.full(len(places_m), _WHOLE)
        rows = zip(places_m.tolist(), is_exact.tolist(), strict=True)
        return np.array([self._numbered(self._row_of(place, exact), exact) for place, exact in rows], dtype=int)

    def _row_of(self, place_m: list[float], is_exact: bool) -> tuple[int, int, int]:
        (x, y, z), (east, north, up) = place_m, self._sides[is_exact]
        return math.floor(x / east), math.floor(y / north), math.floor(z / up)

    def _numbered(self, row: tuple[int, int, int], is_exact: bool) -> int:
        """Return the number of a tile, which is new the first time."""
        number = self._number[is_exact].setdefault(row, len(self._boxes))
        if number == len(self._boxes):
            side = np.array(self._sides[is_exact])
            low = np.array(row) * side
            self._boxes.append((low, low + side))
        return number

    def flat_tiles(self, places_m: np.ndarray) -> np.ndarray:
        """Return the models (n, 2) of places (n, 3) m, mine frame, whose floor is one plane.

        The number is `NONE` for others, and the code where it depends on the zones of the wheels.
        """
        if self.whole:
            return np.full((len(places_m), 2), NONE)
        rows = [self._row_of(place, False) for place in places_m.tolist()]
        return np.array([self._flat_choice.get(row) or self._look_at(row) for row in rows], dtype=int)

    def _look_at(self, row: tuple[int, int, int]) -> tuple[int, int]:
        """Find out whether a tile's floor is one plane, and in one zone."""
        number = self._numbered(row, False)
        low, high = self._reach_of(self._boxes[number], in_any_position=True)
        zones, flat = self.world.zones_at(np.array([low[0], high[0]])), self._floors.within(low, high)
        choice = (NONE, NONE)
        if flat is not None:
            self._flat[number] = flat
            if self.is_level:  # they differ by their walls alone
                number = self._alike.setdefault(tuple(self._parts_within(low, high, ROCK_BIT)), number)
            choice = number, int(code_of(np.zeros(1, int), zones[None])[0]) if zones[0] == zones[1] else NONE
        self._flat_choice[row] = choice
        return choice

    def model(self, tile: Tile) -> mujoco.MjModel:
        """Compile the model of a tile's number and a code.

        Raises
        ------
        BundleError
            If MuJoCo refuses a part; the message is MuJoCo's.
        """
        return self.world.compile(with_little_memory(self.spec(tile)))

    def spec(self, tile: Tile | None, robots: tuple[str, ...] = ("robot",)) -> mujoco.MjSpec:
        """Return a model's spec; without a tile it holds all parts, and robots whose feet touch them."""
        number, code = tile or (_WHOLE, (1 << len(FEET)) - 1)
        has_boxes = self.has_planes and tile is not None
        on_parts = code & (1 << len(FEET)) - 1
        spec = physics_spec(self.task)
        if number != _WHOLE:
            # A tile has few parts, and one robot is one island: looking for either costs more than it saves.
            spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE | mujoco.mjtDisableBit.mjDSBL_ISLAND
        mine = spec.worldbody.add_body(name=MINE_BODY, pos=self.T_world_mine[:3, 3])
        rock, ground = mine.add_body(name=ROCK_BODY), mine.add_body(name="ground")
        friction = [float(self.world.record["rock_friction"]), 0.005, 0.0001]
        for name, corners, bits in self._within(number, on_parts):
            add_part(spec, ground if bits == FLOOR_BIT else rock, name, corners, contype=bits, friction=friction)
        flat = self._flat.get(number)
        if flat is not None:
            flat.add_to(mine)
        for name in robots:
            self._add_robot(spec, name, code, has_boxes, flat is not None)
        return spec

    def friction_of(self, zone: int) -> list[float]:
        """Return the friction of a wheel in a zone, by number."""
        return [self._zones[zone].friction, 0.005, 0.0001]

    def _within(self, number: int, on_parts: int) -> Iterator[tuple[str, np.ndarray, int]]:
        """Yield name, corners and bits of the parts in reach of a tile's robot."""
        low, high = self._reach(number, on_parts)
        bit = ROCK_BIT | FLOOR_BIT if on_parts else ROCK_BIT
        for k in self._parts_within(low, high, bit):
            yield f"part_{k}", self._parts[k], int(self._bits[k] & bit)

    def _parts_within(self, low: np.ndarray, high: np.ndarray, bit: int) -> list[int]:
        """Return the numbers of parts of some bits in a box from `low` (3,) to `high` (3,) m."""
        near = ((self._low < high[:, None]) & (self._high > low[:, None])).all(axis=0)
        found: list[int] = (near & (self._bits & bit != 0)).nonzero()[0].tolist()
        return found

    def _reach(self, number: int, on_parts: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the lowest and the highest corner (3,) m of the box that a robot in a tile can reach in one step."""
        if number == _WHOLE:
            return np.full(3, -np.inf), np.full(3, np.inf)
        return self._reach_of(self._boxes[number], on_parts != 0 or number in self._flat)

    def _reach_of(self, box: tuple[np.ndarray, np.ndarray], in_any_position: bool) -> tuple[np.ndarray, np.ndarray]:
        """Return the reach of a robot in a box from corner to corner (3,) m, on planes or in any position."""
        step_s, beside = self.task.control_s, self.robot.radius_m + MARGIN_M
        aside = beside + self.task.max_forward_mps * step_s
        below, above = -_BAND_M[0], _BAND_M[1]
        if in_any_position:  # it may fall
            below = beside + (FASTEST_FALL_MPS + _GRAVITY_MPS2 * step_s / 2) * step_s
            above = self.robot.radius_m + _ABOVE_M
        low, high = box
        return low - [aside, aside, below], high + np.array([aside, aside, above])

    def _add_robot(self, spec: mujoco.MjSpec, name: str, code: int, has_boxes: bool, on_one: bool) -> None:
        """Add a robot; one on boxes is alone, without the geoms that then touch nothing: each costs a test a part."""
        if has_boxes:
            _add_boxes(spec, name, not on_one)
        self.robot.attach(spec, name)
        if not self.is_level:
            stand_on_facets(spec, name)
        for geom in list(spec.geoms) if has_boxes or on_one else ():
            if geom.mass == 0 and not (geom.contype | geom.conaffinity) & ~ROBOT_BIT:
                spec.delete(geom)
        for k, end in enumerate(FEET if has_boxes and not on_one else ()):
            spec.geom(f"{name}_{end}").conaffinity = _FOOT_BITS[k] | (FLOOR_BIT if code >> k & 1 else 0)
        for k, wheels in enumerate(self.robot.SIDES):
            zone = code >> (len(FEET) + k * _ZONE_BITS) & (1 << _ZONE_BITS) - 1
            for wheel in wheels:
                geom = spec.geom(f"{name}_{wheel}")
                if geom is not None:  # another robot may have none
                    geom.priority, geom.friction = 1, self.friction_of(zone)
                    if not on_one and (not has_boxes or code >> k & 1):
                        keep_in_disc(geom, self.robot.radius_m)
        contact_sensor(spec, name)


def _add_boxes(spec: mujoco.MjSpec, name: str, are_solid: bool) -> None:
    """Add a box under each foot of a robot, parked; one that is not solid has its place in the state alone."""
    for k, place in enumerate(PARKED_M):
        body = spec.worldbody.add_body(name=f"{name}_plane_{k}", mocap=True, pos=place)
        middle = [0, 0, -_HALF_M[2]]
        if are_solid:
            bits = {"contype": _FOOT_BITS[k], "conaffinity": 0}
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=_HALF_M, pos=middle, **bits)
