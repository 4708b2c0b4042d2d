"""Local models of a volume: walls in reach, and a plane under each wheel where the floor is flat for a control step."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import mujoco
import numpy as np

from benchmarks.comparisons.volume.contact_planes import NODE_M, TOLERANCE_M, FloorPlanes, PlaneTile
from benchmarks.comparisons.volume.shell import ShellPart
from benchmarks.comparisons.volume.volume import Label, Volume
from minexplore.physics.local_models import physics_spec
from minexplore.physics.robot import (
    FLOOR_BIT,
    ROCK_BIT,
    ROCK_BODY,
    RobotParams,
    attach_robot,
    contact_sensor,
    stand_on_facets,
)
from minexplore.rotations import rotation_matrices
from minexplore.task import TaskParams

TILE_M, SLAB_M = 2.0, 0.5
_MARGIN_M = 0.1  # as in minexplore.physics.local_models
_THROWN_MPS = 3.0  # the fastest robot in a model of all parts
_SPEED_MPS = 2.0  # of a wheel over a plane: its way must not leave the plane's disc
_LEAN = float(np.cos(np.radians(25.0)))  # of a robot whose chassis is in `_BAND_M`
_BAND_M = (-0.3, 0.45)  # of the chassis about the axle's height in one control step, leaning by 25 deg
_BELOW_M, _ABOVE_M = 0.8, 0.8  # what any robot can touch about its axle in one control step
_GAP_M = 0.1  # of a wheel from its plane: farther, the plane is another floor's
_PLANE_BITS = {"left": 8, "right": 16, "front": 32, "rear": 64}
_AWAY_M = 1e4
_HALF_M = (0.5, 0.5, 0.25)  # of the box whose top is a plane; it reaches beyond the plane's disc


@dataclass(frozen=True)
class Parts:
    """Parts by their boxes, and which of them are floor."""

    parts: list[ShellPart]
    low: np.ndarray
    high: np.ndarray
    is_floor: np.ndarray

    @classmethod
    def of(cls, volume: Volume, parts: list[ShellPart]) -> Parts:
        """Take a volume's parts."""
        low = np.array([part.corners.min(axis=0) for part in parts])
        high = np.array([part.corners.max(axis=0) for part in parts])
        return cls(parts, low, high, np.array([volume.label[part.facets[0]] == Label.FLOOR for part in parts]))

    def within(self, low: np.ndarray, high: np.ndarray, with_floor: bool = True) -> list[tuple[np.ndarray, bool]]:
        """Return the corners of the parts in a box, cut to it, and which are floor."""
        near = ((self.low < high) & (self.high > low)).all(axis=1) & (with_floor | ~self.is_floor)
        box = manifold3d.Manifold.cube((high - low).tolist()).translate(low.tolist())
        found = []
        for number in np.flatnonzero(near):
            corners = self.parts[number].corners
            if (self.low[number] < low).any() or (self.high[number] > high).any():
                cut = manifold3d.Manifold.hull_points(corners) ^ box
                corners = np.asarray(cut.to_mesh64().vert_properties)[:, :3]
            if len(corners) > 3 and np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)[2] > 1e-6:
                found.append((corners, bool(self.is_floor[number])))
        return found


class VolumeModels:
    """Physics models of a volume, as `PhysicsStepper` takes them: two a tile, with planes or with all parts."""

    def __init__(self, volume: Volume, parts: list[ShellPart], tile_m: float = TILE_M, exact_tile_m: float = TILE_M) -> None:
        """Take the parts, and the sides of the tiles of either kind."""
        self.task, self.robot = TaskParams(), RobotParams()
        self._parts, self._planes = Parts.of(volume, parts), FloorPlanes(volume)
        self._side = {False: np.array([tile_m, tile_m, SLAB_M]), True: np.array([exact_tile_m, exact_tile_m, SLAB_M])}
        self._number: dict[tuple[bool, int, int, int], int] = {}
        self._boxes: list[tuple[np.ndarray, np.ndarray]] = []
        self.tables: dict[int, PlaneTile] = {}

    def tiles_of(self, chosen: np.ndarray) -> np.ndarray:
        """Return the models (n, 2) that were chosen: the number of a tile, and whether it has all parts."""
        return chosen.astype(int)

    def number_of(self, places: np.ndarray, is_exact: bool) -> np.ndarray:
        """Return the numbers (n,) of the tiles that places (n, 3) m are in."""
        side = self._side[is_exact]
        rows = np.floor(places / side).astype(int).tolist()
        return np.array([self._number_of(row, is_exact) for row in rows], dtype=int)

    def _number_of(self, row: list[int], is_exact: bool) -> int:
        key = (is_exact, row[0], row[1], row[2])
        found = self._number.get(key)
        if found is None:
            found = self._number[key] = len(self._boxes)
            low = np.array(row) * self._side[is_exact]
            self._boxes.append((low, low + self._side[is_exact]))
        return found

    def table(self, number: int) -> PlaneTile:
        """Return the planes of a tile."""
        if number not in self.tables:
            self.tables[number] = self._planes.tile(*self._boxes[number])
        return self.tables[number]

    def model(self, tile: tuple[int, int]) -> mujoco.MjModel:
        """Compile the model of a tile."""
        return self.spec(*tile).compile()

    def spec(self, number: int, is_exact: int) -> mujoco.MjSpec:
        """Return the spec of a tile's model: walls in reach, or all parts; the planes; the robot."""
        low, high = self._boxes[number]
        speed = _THROWN_MPS if is_exact else _SPEED_MPS
        aside = self.robot.radius_m + speed * self.task.control_s + _MARGIN_M
        below, above = (_BELOW_M, _ABOVE_M) if is_exact else (-_BAND_M[0], _BAND_M[1])
        near = self._parts.within(
            low - np.array([aside, aside, below]), high + np.array([aside, aside, above]), bool(is_exact)
        )
        spec = physics_spec(self.task)
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
        rock, ground = spec.worldbody.add_body(name=ROCK_BODY), spec.worldbody.add_body(name="ground")
        for k, (corners, is_floor) in enumerate(near):
            middle = corners.mean(axis=0)
            mesh = spec.add_mesh(name=f"part_{k}", uservert=(corners - middle).ravel().tolist())
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
            bits = FLOOR_BIT if is_floor else ROCK_BIT | (FLOOR_BIT if is_exact else 0)
            (ground if is_floor else rock).add_geom(
                type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"part_{k}", pos=middle, contype=bits, conaffinity=0
            )
        for k, (end, bit) in enumerate(_PLANE_BITS.items()):
            body = spec.worldbody.add_body(name=f"plane_{end}", mocap=True, pos=[_AWAY_M * (1 + k), 0, -_AWAY_M])
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_BOX, size=_HALF_M, pos=[0, 0, -_HALF_M[2]], contype=bit, conaffinity=0
            )
        attach_robot(spec, "robot", self.robot)
        stand_on_facets(spec, "robot")
        for end, bit in _PLANE_BITS.items():
            spec.geom(f"robot_{end}").conaffinity = FLOOR_BIT | bit
        contact_sensor(spec, "robot")
        return spec


@dataclass(frozen=True)
class Choice:
    """What a control step of n robots is stepped in.

    `tiles` (n, 2) as `VolumeModels.tiles_of` has them; the places (n, 4, 3) m and quaternions (n, 4, 4) of the planes;
    `over_m` (n, 4), the gap under each wheel.
    """

    tiles: np.ndarray
    places: np.ndarray
    quaternions: np.ndarray


class PlaneChooser:
    """Chooses for each robot the model and the planes of a control step."""

    def __init__(self, models: VolumeModels) -> None:
        """Take the models."""
        robot = models.robot
        half, end, castor = robot.wheel_base_m / 2, robot.radius_m - 0.05, 0.05 - robot.wheel_radius_m
        self._models = models
        self._wheels = np.array([[0, half, 0], [0, -half, 0], [end, 0, castor], [-end, 0, castor]])
        self._radius = np.array([robot.wheel_radius_m] * 2 + [0.05] * 2)

    def choose(self, qpos: np.ndarray, qvel: np.ndarray) -> Choice:
        """Return the choice for robots with these positions (n, 7) and velocities (n, 6) of their free joints."""
        models = self._models
        axes = rotation_matrices(qpos[:, 3:7])
        up = axes[:, :, 2]
        arms = np.einsum("nij,kj->nki", axes, self._wheels)
        spin = np.einsum("nij,nj->ni", axes, qvel[:, 3:])
        speed = qvel[:, None, :3] + np.cross(spin[:, None], arms)
        wheels = qpos[:, None, :3] + arms
        foot = wheels - self._radius[:, None] * up[:, None]
        middle = foot[..., :2] + speed[..., :2] * (models.task.control_s / 2)
        numbers = models.number_of(qpos[:, :3], False)
        plane, error, nodes = self._look_up(numbers, middle)
        height = plane[..., 2] + np.sum((foot[..., :2] - nodes) * plane[..., :2], axis=2)
        with np.errstate(invalid="ignore"):
            good = (error <= TOLERANCE_M) & (np.abs(foot[..., 2] - height) < _GAP_M)
        good = good.all(axis=1) & (up[:, 2] > _LEAN) & (np.linalg.norm(speed, axis=2) < _SPEED_MPS).all(axis=1)
        tiles = np.column_stack([numbers, np.zeros(len(numbers), int)])
        if not good.all():
            tiles[~good] = np.column_stack([models.number_of(qpos[~good, :3], True), np.ones((~good).sum(), int)])
        normal = np.concatenate([-plane[..., :2], np.ones((*plane.shape[:2], 1))], axis=2)
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        quaternions = np.stack(
            [1 + normal[..., 2], -normal[..., 1], normal[..., 0], np.zeros_like(normal[..., 0])], axis=2
        )
        quaternions /= np.linalg.norm(quaternions, axis=2, keepdims=True)
        places = np.concatenate([nodes, plane[..., 2:]], axis=2)
        away = np.array([[_AWAY_M * (1 + k), 0, -_AWAY_M] for k in range(4)])
        places = np.where(good[:, None, None], places, away)
        quaternions = np.where(good[:, None, None], quaternions, [1.0, 0, 0, 0])
        return Choice(tiles, places, quaternions)

    def _look_up(self, numbers: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the planes (n, 4, 3), their errors (n, 4) m and their nodes (n, 4, 2) m next to places (n, 4, 2) m."""
        plane, error = np.zeros((len(numbers), 4, 3)), np.full((len(numbers), 4), np.inf)
        nodes = np.zeros((len(numbers), 4, 2))
        for k, number in enumerate(numbers.tolist()):
            table = self._models.table(number)
            at = np.rint((places[k] - table.first_m) / NODE_M).astype(int)
            if (at < 0).any() or (at >= len(table.error_m)).any():
                continue
            plane[k], error[k] = table.plane[at[:, 1], at[:, 0]], table.error_m[at[:, 1], at[:, 0]]
            nodes[k] = table.first_m + at * NODE_M
        return plane, error, nodes
