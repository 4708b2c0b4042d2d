"""What robots of a batch drive on in a volume: where they start, their models step by step, what lies under them."""

from __future__ import annotations

import mujoco
import numpy as np

from minexplore.physics.robot import FASTEST_FALL_MPS, pose_on
from minexplore.physics.robot_kind import Robot
from minexplore.physics.stepper import PhysicsStepper
from minexplore.rotations import rotation_matrices
from minexplore.task import TaskParams
from minexplore.volume.cells import VolumeGrid
from minexplore.volume.choice import PlaneChooser
from minexplore.volume.columns import FloorColumns
from minexplore.volume.creases import Creases
from minexplore.volume.models import FEET, NONE, VolumeModels, code_of
from minexplore.volume.planes import FloorPlanes
from minexplore.volume.standing import keys_of, standing_spans
from minexplore.world import World

_UNKNOWN = -1
_LOOK_M = 0.3  # over a place: a floor there is at or under it
_BOTH = np.array([1.0, -1.0])  # sides
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class VolumeGround:
    """A volume as `RobotBatch` needs it; see `minexplore.envs.ground.RobotGround`."""

    def __init__(self, world: World, task: TaskParams, robot: Robot, count: int, whole: bool) -> None:
        """Index the floors and find the cells that the robot reaches."""
        assert world.volume is not None
        self.world, self.task, self.robot = world, task, robot
        spans, self._facets = world.volume.spans, world.volume.facets
        self.anchor_m = np.array(world.record["spawn"]["anchor_m"])
        try:
            self._standing = standing_spans(spans, robot, self.anchor_m)
        except ValueError as error:
            raise ValueError(f"{world.folder}: {error}") from error
        self._origin_m, self._cell_m = spans.origin_m, spans.cell_m
        usable = np.flatnonzero(spans.storey >= 0)
        keys = keys_of(spans.column[usable], spans.row[usable])
        order = np.argsort(keys, kind="stable")
        # By columns: their keys, and the spans' heights, m, and numbers.
        self._keys, self._spans, self._heights_m = keys[order], usable[order], spans.floor_m[usable[order]]
        self._span = np.full(count, usable[0])  # under each robot
        self._storey, self._leg = spans.storey.astype(int), np.full(len(spans.storey), _UNKNOWN)
        near = np.hypot(*(spans.places_m[:, :2] - self.anchor_m[:2]).T) <= task.region_m
        self.grid = VolumeGrid(spans, self._standing & near, task.cell_m)
        self.models = VolumeModels(world, task, robot, whole)
        self.T_world_mine = self.models.T_world_mine
        self._columns = FloorColumns(self._facets)
        self._chooser = PlaneChooser(self.models, FloorPlanes(self._columns, Creases(self._facets)))
        self._addresses: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def start_m(self) -> np.ndarray:
        """Return the model (2,) that robots have before they are placed."""
        flat = self.models.flat_tiles(self.anchor_m[None] + [0.0, 0.0, self.robot.wheel_radius_m])[0]
        if self.models.is_level:
            return np.array([flat[0], 0])
        number = self.models.numbers_of(self.anchor_m[None], np.array([not self.models.has_planes]))
        on_parts = np.zeros(1, int) if self.models.has_planes else np.full(1, (1 << len(FEET)) - 1)
        return np.append(number, code_of(on_parts, np.zeros((1, 2), int)))

    def places(self, clearance_m: float) -> np.ndarray:
        """Return the reachable places (n, 3) m that have at least a clearance."""
        spans = self.world.volume.spans  # type: ignore[union-attr]
        found: np.ndarray = spans.roomiest_m[self._standing & (spans.clearance_m >= clearance_m)]
        return found

    def pose(self, place_m: np.ndarray, yaw_rad: float) -> np.ndarray:
        """Return the free joint's place (m) and quaternion (7,), world frame, of a robot on the floor at a place.

        A place (3,) m is on the highest floor at or a little over it. A place (2,) m is on the highest floor there.
        """
        x, y, *z = place_m.tolist()
        facet = self._columns.facets_under(np.array([[x, y, (z[0] if z else np.inf) + _LOOK_M]]))
        if facet[0] < 0:
            raise ValueError(f"{self.world.folder}: no floor under {x:g} {y:g}")
        normal = -self._columns.normals[facet[0]]
        up = normal / np.linalg.norm(normal)
        ahead = np.array([1.0, 0.0, -up[0] / up[2]])
        ahead /= np.linalg.norm(ahead)
        stand = np.array([x, y, self._columns.heights_on(facet, np.array([[x, y]]))[0]])
        axes = np.column_stack([ahead, np.cross(up, ahead), up])
        return pose_on(self.T_world_mine, self.robot, stand, axes, yaw_rad)

    def brake(self, robots: np.ndarray, places_m: np.ndarray, qvel: np.ndarray) -> None:
        """Slow the robots (k,) that fall: `qvel` has a row for each of all robots."""
        qvel[robots, 2] = np.maximum(qvel[robots, 2], -FASTEST_FALL_MPS)

    def prepare(self, stepper: PhysicsStepper, robots: np.ndarray, places_m: np.ndarray) -> np.ndarray:
        """Return the models (k, 2) to step robots (k,) at places (k, 3) m in."""
        tiles = self.models.flat_tiles(places_m)
        own = (tiles[:, 1] == NONE).nonzero()[0]  # their number is none then too, or their wheels are in two zones
        if not len(own):
            return tiles
        robots, places_m = robots[own], places_m[own]
        axes = rotation_matrices(stepper.qpos[robots, 3:7])
        zones = self._wheel_zones(places_m, axes)
        uneven = tiles[own, 0] == NONE
        if np.count_nonzero(uneven) == len(own):
            tiles[own] = self._on_planes(stepper, robots, places_m, axes, zones)
            return tiles
        tiles[own, 1] = code_of(np.zeros(len(own), int), zones)
        if np.count_nonzero(uneven):
            given = (array[uneven] for array in (robots, places_m, axes, zones))
            tiles[own[uneven]] = self._on_planes(stepper, *given)
        return tiles

    def _on_planes(
        self, stepper: PhysicsStepper, robots: np.ndarray, places_m: np.ndarray, axes: np.ndarray, zones: np.ndarray
    ) -> np.ndarray:
        """Set the boxes under the feet of robots whose floor is not one plane; return their models (k, 2)."""
        choice = self._chooser.choose(places_m, axes, stepper.qvel[robots, :6], zones)
        if self.models.has_planes:
            where, how = self._addresses or self._find_addresses(stepper)
            moved = choice.places + np.where(choice.on_plane[..., None], self.T_world_mine[:3, 3], 0.0)
            stepper.state[robots[:, None], where] = moved.reshape(len(robots), -1)
            stepper.state[robots[:, None], how] = choice.quaternions.reshape(len(robots), -1)
        return choice.tiles

    def _find_addresses(self, stepper: PhysicsStepper) -> tuple[np.ndarray, np.ndarray]:
        """Return where the places and the quaternions of the boxes stand in the integration state."""
        number, code = self.start_m.tolist()
        model = self.models.model((number, code))
        data, state = mujoco.MjData(model), np.zeros(mujoco.mj_stateSize(model, _STATE))
        data.mocap_pos[:], data.mocap_quat[:] = np.pi, np.e
        mujoco.mj_getState(model, data, state, _STATE)
        self._addresses = np.flatnonzero(state == np.pi), np.flatnonzero(state == np.e)
        return self._addresses

    def _wheel_zones(self, places_m: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """Return the numbers (k, 2) of the zones that the wheels of robots are in; axes (k, 3, 3) are columns."""
        left = axes[:, 0, 1] * (self.robot.between_sides_m / 2)
        return self.world.zones_at(places_m[:, :1] + left[:, None] * _BOTH)

    def prepare_team(
        self, model: mujoco.MjModel, names: tuple[str, ...], places_m: np.ndarray, quat: np.ndarray
    ) -> None:
        """Give the wheels of a team's robots at places (n, 3) m the friction of their zones."""
        for name, zones in zip(names, self._wheel_zones(places_m, rotation_matrices(quat)).tolist(), strict=True):
            for wheels, zone in zip(self.robot.SIDES, zones, strict=True):
                for wheel in wheels:
                    model.geom(f"{name}_{wheel}").friction = self.models.friction_of(zone)

    def info(self, robots: np.ndarray, places_m: np.ndarray) -> dict[str, np.ndarray]:
        """Return the storey and the leg under robots (k,) at places (k, 3) m."""
        spans = self._spans_under(robots, places_m)
        return {"floor": self._storey[spans], "leg": self._leg_of(spans)}

    def _spans_under(self, robots: np.ndarray, places_m: np.ndarray) -> np.ndarray:
        """Return robots' spans (k,): of their columns the nearest in height, those before where columns have none."""
        cells = np.floor((places_m[:, :2] - self._origin_m) / self._cell_m).astype(int)
        keys = keys_of(cells[:, 0], cells[:, 1])
        at, end = self._keys.searchsorted(keys), self._keys.searchsorted(keys, side="right")
        for k in (end - at > 1).nonzero()[0].tolist():
            at[k] += np.abs(self._heights_m[at[k] : end[k]] - places_m[k, 2]).argmin()
        nearest = self._spans[np.minimum(at, len(self._spans) - 1)]
        found = self._span[robots] = np.where(at < end, nearest, self._span[robots])
        return found

    def _leg_of(self, spans: np.ndarray) -> np.ndarray:
        """Return the legs (k,) whose floors are in the middles of spans (k,); each is looked for once."""
        found = self._leg[spans]
        unknown = spans[found == _UNKNOWN]
        if len(unknown):
            places = self.world.volume.spans.places_m[unknown] + [0.0, 0.0, _LOOK_M]  # type: ignore[union-attr]
            self._leg[unknown] = self._facets.leg[np.maximum(self._columns.facets_under(places), 0)]
            found = self._leg[spans]
        return found
