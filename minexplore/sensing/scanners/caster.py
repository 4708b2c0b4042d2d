"""Hits of many rays on a world: how far, on what, and at which incidence."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from minexplore.bundle import has_visible_rock
from minexplore.sensing.facet_meshes import volume_meshes
from minexplore.sensing.lidar import Backend, Lidar, collision_meshes, surface_meshes
from minexplore.sensing.scanners.labels import FLOOR, NOTHING, ROOF, label_of_mesh, label_of_zone
from minexplore.world import World, load_world


@dataclass(frozen=True)
class Hits:
    """What rays hit.

    `range_m` (n,) float32, inf where a ray hits nothing; `label` (n,) uint8 of `LABELS`; `cosine` (n,) float32 of the
    angle between ray and the surface's normal, from 0 (grazing) to 1.
    """

    range_m: np.ndarray
    label: np.ndarray
    cosine: np.ndarray


class SurfaceCaster:
    """Casts rays of the mine frame against all surfaces of a world; see `Lidar` for what beams hit."""

    def __init__(self, world: World, range_m: float, backend: Backend = "auto") -> None:
        """Take the world's surfaces; scenes are made when rays start in their tile."""
        visible = has_visible_rock(world.record)
        self._floor_m, self._roof_m = 0.0, np.inf
        if world.volume is not None:
            meshes, self._floor_m = volume_meshes(world, world.volume.facets), -np.inf
        elif visible:
            meshes = surface_meshes(world)
        else:
            meshes, self._roof_m = collision_meshes(world), float(world.record["height_m"])
        self.range_m = range_m
        self._lidar = Lidar(meshes, range_m, backend)
        faces = [len(faces) for _, faces in meshes.values()]
        labels = np.repeat(np.array([label_of_mesh(name) for name in meshes], dtype=np.uint8), faces)
        normals = self._lidar.planes[:, :3]
        length = np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        # The last row is that of rays that hit nothing, whose face has the number -1.
        self._labels = np.append(labels, np.uint8(NOTHING))
        self._normals = np.vstack([normals / length, np.zeros(3)]).astype(np.float32)
        self._zones = np.array([label_of_zone(zone) for zone in world.floor_zones], dtype=np.uint8)
        self._zones_at = world.zones_at

    def strike(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return distances and faces of hits without level floors and labels; see `Lidar.hits`."""
        return self._lidar.hits(origins, directions)

    def cast(self, origins: np.ndarray, directions: np.ndarray) -> Hits:
        """Return the hits of unit rays.

        Parameters
        ----------
        origins : (3,) or (n, 3), m, mine frame
            All within a metre of the first, as during one scan.
        directions : (n, 3) float32, unit vectors
        """
        found, face = self.strike(origins, directions)
        label = self._labels[face]
        cosine = np.abs(np.einsum("ij,ij->i", self._normals[face], directions))
        self._level(np.asarray(origins[..., 2], dtype=np.float32), directions[:, 2], found, label, cosine)
        missed = np.flatnonzero(found > self.range_m)
        found[missed], label[missed] = np.inf, NOTHING
        self._name_zones(origins[..., 0], directions[:, 0], found, label)
        return Hits(found, label, cosine)

    def _level(
        self, height: np.ndarray, slope: np.ndarray, found: np.ndarray, label: np.ndarray, cosine: np.ndarray
    ) -> None:
        """Let a level floor and roof stop the rays that meet them first."""
        for level_m, name in ((self._floor_m, FLOOR), (self._roof_m, ROOF)):
            if not np.isfinite(level_m):
                continue
            with np.errstate(divide="ignore", invalid="ignore"):
                reach = (np.float32(level_m) - height) / slope
            nearer = np.flatnonzero((reach < found) & (reach > 0))
            found[nearer], label[nearer], cosine[nearer] = reach[nearer], name, np.abs(slope[nearer])

    def _name_zones(self, east_m: np.ndarray, along: np.ndarray, found: np.ndarray, label: np.ndarray) -> None:
        """Let floors have the labels of their zones."""
        on_floor = np.flatnonzero(label == FLOOR)
        starts = east_m[on_floor] if np.ndim(east_m) else east_m
        label[on_floor] = self._zones[self._zones_at(starts + along[on_floor] * found[on_floor])]


def shared_caster(world: World, range_m: float, backend: Backend = "auto") -> SurfaceCaster:
    """Return what casts rays in a world, made once a process."""
    return _shared(world.folder, world.record["world_sha256"], range_m, backend)


@functools.lru_cache(maxsize=4)
def _shared(folder: Path, world_sha256: str, range_m: float, backend: Backend) -> SurfaceCaster:
    return SurfaceCaster(load_world(folder), range_m, backend)
