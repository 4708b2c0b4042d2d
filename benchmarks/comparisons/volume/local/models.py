"""Local models of a volume: walls in reach, and a plane under each wheel where the floor is flat for a control step."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import mujoco
import numpy as np

from benchmarks.comparisons.volume.local.planes import FloorPlanes
from minexplore.physics.local_models import physics_spec
from minexplore.physics.robot import (
    FLOOR_BIT,
    ROBOT_BIT,
    ROCK_BIT,
    ROCK_BODY,
    RobotParams,
    attach_robot,
    contact_sensor,
    stand_on_facets,
)
from minexplore.task import TaskParams
from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Label, Volume

TILE_M, EXACT_TILE_M = (1.0, 0.5), (0.5, 0.25)  # width and height of a tile
_MARGIN_M = 0.1  # as in minexplore.physics.local_models
FASTEST_MPS = 1.5  # of a robot, as TaskParams has it
_BAND_M = (-0.3, 0.45)  # of the chassis about the axle's height in one control step, leaning by 25 deg
_BELOW_M, _ABOVE_M = 0.6, 0.6  # what any robot can touch about its axle in one control step
_SLIVER_M = 1e-6  # MuJoCo refuses a part that is thinner
FEET = ("left", "right", "front", "rear")
_FOOT_BITS = (8, 16, 32, 64)
_HALF_M = (0.5, 0.5, 0.25)  # of a box whose top is a plane; it reaches beyond the plane's disc
PARKED = np.array([[1e4 * (1 + k), 0.0, -1e4] for k in range(len(FEET))])  # places of unused boxes
_STEEP, _TALL_M = 0.5, 0.4  # a part whose facet is as upright, and that is as tall, stops a chassis before a wheel


@dataclass(frozen=True)
class BoxedParts:
    """Parts by their boxes, and the contact bits of what they stop: `FLOOR_BIT` wheels, `ROCK_BIT` the chassis."""

    parts: list[ShellPart]
    low: np.ndarray
    high: np.ndarray
    bits: np.ndarray

    @classmethod
    def of(cls, volume: Volume, parts: list[ShellPart]) -> BoxedParts:
        """Take a volume's parts."""
        low = np.array([part.corners.min(axis=0) for part in parts])
        high = np.array([part.corners.max(axis=0) for part in parts])
        normal = volume.normals
        size = np.linalg.norm(normal, axis=1)
        biggest = np.array([max(part.facets, key=lambda k: float(size[k])) for part in parts])
        lies = normal[biggest, 2] < -_STEEP * size[biggest]
        bits = np.where(lies | ((high - low)[:, 2] < _TALL_M), ROCK_BIT | FLOOR_BIT, ROCK_BIT)
        bits[volume.label[biggest] == Label.FLOOR] = FLOOR_BIT
        return cls(parts, low, high, bits)

    def within(self, low: np.ndarray, high: np.ndarray, bit: int) -> list[tuple[np.ndarray, int]]:
        """Return corners and bits of the parts in a box that have any of some bits, cut to the box."""
        near = ((self.low < high) & (self.high > low)).all(axis=1) & (self.bits & bit != 0)
        box = manifold3d.Manifold.cube((high - low).tolist()).translate(low.tolist())
        found = []
        for number in np.flatnonzero(near):
            corners = self.parts[number].corners
            if (self.low[number] < low).any() or (self.high[number] > high).any():
                cut = manifold3d.Manifold.hull_points(corners) ^ box
                corners = np.asarray(cut.to_mesh64().vert_properties)[:, :3]
            if len(corners) > 3 and np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)[2] > _SLIVER_M:
                found.append((corners, int(self.bits[number] & bit)))
        return found


class VolumeModels:
    """Physics models of a volume, as `PhysicsStepper` takes them: of walls, or of all parts for some of the feet."""

    def __init__(
        self,
        volume: Volume,
        parts: list[ShellPart],
        tile_m: tuple[float, float] = TILE_M,
        exact_tile_m: tuple[float, float] = EXACT_TILE_M,
        fastest_mps: float = FASTEST_MPS,
    ) -> None:
        """Take the parts, and the sides of the tiles of either kind."""
        self.task, self.robot, self.fastest_mps = TaskParams(), RobotParams(), fastest_mps
        self._parts, self.planes = BoxedParts.of(volume, parts), FloorPlanes(volume)
        self._side = {k: np.array([side[0], *side]) for k, side in ((False, tile_m), (True, exact_tile_m))}
        self._number: dict[bool, dict[tuple[int, int, int], int]] = {False: {}, True: {}}
        self._boxes: list[tuple[np.ndarray, np.ndarray]] = []

    def tiles_of(self, chosen: np.ndarray) -> np.ndarray:
        """Return the models (n, 2) that were chosen: the number of a tile, and which feet touch the floor's parts."""
        return chosen.astype(int)

    def number_of(self, places: np.ndarray, is_exact: bool) -> np.ndarray:
        """Return the numbers (n,) of the tiles that places (n, 3) m are in."""
        numbers, side = self._number[is_exact], self._side[is_exact]
        rows = [(x, y, z) for x, y, z in np.floor(places / side).astype(int).tolist()]
        for row in rows:
            if row not in numbers:
                numbers[row] = len(self._boxes)
                self._boxes.append((np.array(row) * side, np.array(row) * side + side))
        return np.array([numbers[row] for row in rows], dtype=int)

    def model(self, tile: tuple[int, int]) -> mujoco.MjModel:
        """Compile the model of a tile."""
        return self.spec(*tile).compile()

    def spec(self, number: int, feet: int) -> mujoco.MjSpec:
        """Return the spec of a tile's model: walls in reach, or all parts; a box under each foot; the robot.

        `feet` has a bit for each foot that stands on the floor's parts instead of its box.
        """
        low, high = self._boxes[number]
        aside = self.robot.radius_m + self.fastest_mps * self.task.control_s + _MARGIN_M
        below, above = (_BELOW_M, _ABOVE_M) if feet else (-_BAND_M[0], _BAND_M[1])
        reach = np.array([aside, aside, below]), np.array([aside, aside, above])
        near = self._parts.within(low - reach[0], high + reach[1], ROCK_BIT | FLOOR_BIT if feet else ROCK_BIT)
        spec = physics_spec(self.task)
        # A tile has few parts, and one robot is one island: looking for either structure costs more than it saves.
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE | mujoco.mjtDisableBit.mjDSBL_ISLAND
        rock, ground = spec.worldbody.add_body(name=ROCK_BODY), spec.worldbody.add_body(name="ground")
        for k, (corners, bits) in enumerate(near):
            middle = corners.mean(axis=0)
            mesh = spec.add_mesh(name=f"part_{k}", uservert=(corners - middle).ravel().tolist())
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
            (ground if bits == FLOOR_BIT else rock).add_geom(
                type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"part_{k}", pos=middle, contype=bits, conaffinity=0
            )
        for k, place in enumerate(PARKED):
            body = spec.worldbody.add_body(name=f"plane_{k}", mocap=True, pos=place)
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=_HALF_M,
                pos=[0, 0, -_HALF_M[2]],
                contype=_FOOT_BITS[k],
                conaffinity=0,
            )
        self._add_robot(spec, feet)
        return spec

    def _add_robot(self, spec: mujoco.MjSpec, feet: int) -> None:
        """Add the robot without the geoms that touch nothing when it is alone: each costs a test a part."""
        attach_robot(spec, "robot", self.robot)
        stand_on_facets(spec, "robot")
        for geom in list(spec.geoms):
            if geom.mass == 0 and not (geom.contype | geom.conaffinity) & ~ROBOT_BIT:
                spec.delete(geom)
        for k, end in enumerate(FEET):
            spec.geom(f"robot_{end}").conaffinity = _FOOT_BITS[k] | (FLOOR_BIT if feet >> k & 1 else 0)
        contact_sensor(spec, "robot")
