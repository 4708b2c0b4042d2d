"""The convex parts of rock of a volume as geoms: all that are in a box, floors with the friction of their zones."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from minexplore.bundle import MINE_BODY
from minexplore.floors.volume_arrays import FacetLabel, Parts
from minexplore.physics.local_models import physics_spec
from minexplore.physics.robot import FLOOR_BIT, ROCK_BIT, ROCK_BODY
from minexplore.task import TaskParams
from minexplore.world import World

# Wheels climb what is low of a wall.
_BITS = {FacetLabel.FLOOR: FLOOR_BIT, FacetLabel.WALL: ROCK_BIT | FLOOR_BIT, FacetLabel.ROOF: ROCK_BIT}


class PartsOfRock:
    """The parts of a world that is one volume; a part has the friction of the zone that its middle lies in."""

    def __init__(self, world: World, task: TaskParams) -> None:
        """Take the world's parts."""
        assert world.volume is not None
        self.world, self._task, self._parts = world, task, world.volume.parts
        self._low, self._high = self._parts.boxes_m
        zones = world.zones_at((self._low[:, 0] + self._high[:, 0]) / 2)
        floor = [zone.friction for zone in world.active_zones(task.terrain)]
        self._is_floor = self._parts.label == FacetLabel.FLOOR
        self._friction = np.where(self._is_floor, np.array(floor)[zones], float(world.record["rock_friction"]))
        self._bits = bits_of(self._parts)

    def spec(self, low_m: np.ndarray, high_m: np.ndarray) -> mujoco.MjSpec:
        """Return the spec of the parts that reach into a box from `low_m` (3,) to `high_m` (3,), mine frame."""
        spec = physics_spec(self._task)
        mine = spec.worldbody.add_body(name=MINE_BODY, pos=self.world.T_world_mine[:3, 3])
        solid = mine.add_body(name=ROCK_BODY)
        for k in np.flatnonzero(((self._low < high_m) & (self._high > low_m)).all(axis=1)).tolist():
            friction, priority = [float(self._friction[k]), 0.005, 0.0001], int(self._is_floor[k])
            bits, name = int(self._bits[k]), f"part_{k}"
            geom = add_part(spec, mine if priority else solid, name, self._parts[k], contype=bits, friction=friction)
            geom.name, geom.priority = name, priority
        return spec


def bits_of(parts: Parts) -> np.ndarray:
    """Return the bits of contype (p,) that robots on wheels expect of parts."""
    found: np.ndarray = np.array([_BITS[label] for label in FacetLabel])[parts.label]
    return found


def add_part(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, mesh_name: str, corners: np.ndarray, **attributes: Any
) -> mujoco.MjsGeom:
    """Add a convex part of rock by its corners (k, 3) m; return its geom.

    It lies about its middle, as MuJoCo has vertices in 32 bits: findings/mujoco-mesh-corners-of-32-bits.sh.
    """
    middle = corners.mean(axis=0)
    mesh = spec.add_mesh(name=mesh_name, uservert=(corners - middle).ravel().tolist())
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    return body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh_name, pos=middle, conaffinity=0, **attributes)
