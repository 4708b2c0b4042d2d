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
from minexplore.volume.models import FEET, VolumeModels, code_of
from minexplore.volume.planes import FloorPlanes
from minexplore.volume.standing import standing_spans
from minexplore.world import World

_LOOK_M = 0.3  # over a place: a floor there is at or under it
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
        usable = np.flatnonzero(spans.storey >= 0)
        column = np.column_stack([spans.column, spans.row])[usable]
        keys, first = np.unique(column, axis=0, return_inverse=True)
        order = np.argsort(first.reshape(-1), kind="stable")
        groups = np.split(usable[order], np.cumsum(np.bincount(first.reshape(-1)))[:-1])
        self._in_column = dict(zip(map(tuple, keys.tolist()), groups, strict=True))
        self._storey = np.zeros(count, int)  # of each robot
        near = np.hypot(*(spans.places_m[:, :2] - self.anchor_m[:2]).T) <= task.region_m
        self.grid = VolumeGrid(spans, self._standing & near, task.cell_m)
        self.models = VolumeModels(world, task, robot, whole)
        self.T_world_mine = self.models.T_world_mine
        self._columns = FloorColumns(self._facets)
        self._chooser = PlaneChooser(self.models, FloorPlanes(self._columns, Creases(self._facets)))
        self._under = np.full(count, -1)  # facet under each robot when it was last looked for
        self._addresses: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def start_m(self) -> np.ndarray:
        """Return the model (2,) that robots have before they are placed."""
        number = self.models.number_of(self.anchor_m[None], not self.models.has_planes)
        on_parts = np.zeros(1, int) if self.models.has_planes else np.full(1, (1 << len(FEET)) - 1)
        return np.append(number, code_of(on_parts, np.zeros((1, 2), int)))

    def entrance_places(self, clearance_m: float) -> np.ndarray:
        """Return the reachable places (n, 3) m of the entrance region that have at least a clearance."""
        spans, spawn = self.world.volume.spans, self.world.record["spawn"]  # type: ignore[union-attr]
        wide = self._standing & (spans.clearance_m >= clearance_m)
        places = spans.roomiest_m[wide]
        found: np.ndarray = places[np.linalg.norm(places - spawn["centre_m"], axis=1) <= spawn["radius_m"]]
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
        """Set the boxes under the feet of robots (k,) at places (k, 3) m; return the models (k, 2) to step them in."""
        quat = stepper.qpos[robots, 3:7]
        choice = self._chooser.choose(places_m, quat, stepper.qvel[robots, :6], self._wheel_zones(places_m, quat))
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

    def _wheel_zones(self, places_m: np.ndarray, quat: np.ndarray) -> np.ndarray:
        """Return the numbers (k, 2) of the zones that the wheels of robots are in."""
        left = rotation_matrices(quat)[:, 0, 1] * (self.robot.between_sides_m / 2)
        east = np.stack([places_m[:, 0] + left, places_m[:, 0] - left], axis=1)
        return self.world.zones_at(east.ravel()).reshape(-1, 2)

    def prepare_team(
        self, model: mujoco.MjModel, names: tuple[str, ...], places_m: np.ndarray, quat: np.ndarray
    ) -> None:
        """Give the wheels of a team's robots at places (n, 3) m the friction of their zones."""
        for name, zones in zip(names, self._wheel_zones(places_m, quat).tolist(), strict=True):
            for wheels, zone in zip(self.robot.SIDES, zones, strict=True):
                for wheel in wheels:
                    model.geom(f"{name}_{wheel}").friction = self.models.friction_of(zone)

    def info(self, robots: np.ndarray, places_m: np.ndarray) -> dict[str, np.ndarray]:
        """Return the storey and the leg under robots (k,) at places (k, 3) m."""
        facet = self._follow(robots, places_m)
        return {"floor": self._storeys(robots, places_m), "leg": self._facets.leg[facet].astype(int)}

    def _storeys(self, robots: np.ndarray, places_m: np.ndarray) -> np.ndarray:
        """Return the storey (k,) of robots: that of their column's nearest floor with one, or the one before."""
        spans = self.world.volume.spans  # type: ignore[union-attr]
        cell = np.floor((places_m[:, :2] - spans.origin_m) / spans.cell_m).astype(int)
        for robot, key, z in zip(robots.tolist(), map(tuple, cell.tolist()), places_m[:, 2].tolist(), strict=True):
            own = self._in_column.get(key)
            if own is not None:
                self._storey[robot] = spans.storey[own[np.abs(spans.floor_m[own] - z).argmin()]]
        return self._storey[robots]

    def _follow(self, robots: np.ndarray, places_m: np.ndarray) -> np.ndarray:
        """Return the facet (k,) under each robot; one that is still over its facet is not looked for."""
        facet = self._under[robots]
        on = self._columns.are_over(places_m[:, :2], facet)
        above = places_m[:, 2] - self._columns.heights_on(facet, places_m[:, :2])
        on &= (above >= 0) & (above < 2 * _LOOK_M)
        lost = np.flatnonzero(~on)
        if len(lost):
            found = self._columns.facets_under(places_m[lost])
            facet[lost] = np.where(found < 0, np.maximum(facet[lost], 0), found)
            self._under[robots] = facet
        return facet
