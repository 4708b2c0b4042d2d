"""Beams against the visible rock, or the collision walls where a world shows none: exact rays.

Embree casts them, or Open3D where Embree has no package.
"""

from __future__ import annotations

import functools
from collections import OrderedDict
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

import mujoco
import numpy as np

from minexplore.bundle import (
    GeomGroup,
    has_visible_rock,
    is_rock,
    stops_beams,
)
from minexplore.rotations import rotate_inverse
from minexplore.sensing.planes import face_planes, plane_distances
from minexplore.tiles import Tile, group_by_tile, tile_at, tiles_at
from minexplore.world import World, checked_world

Backend = Literal["auto", "embree", "open3d"]
Meshes = dict[str, tuple[np.ndarray, np.ndarray]]
# Origins (n, 3) or (3,) and directions (n, 3) -> distances (n,) m, inf for no hit, and the mesh and face of each hit,
# else -1.
Cast = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]

_MODULES = {"embree": "embreex", "open3d": "open3d"}  # fastest first
_TILE_M = 40.0
_BYTES_PER_FACE = {"embree": 90, "open3d": 135}  # of a scene; measured 85 and 132
_SCENES_BYTES = 2 << 30  # kept by a process; all scenes of the embedded mine take 0.7 GB by Embree


def surface_meshes(world: World) -> Meshes:
    """Return the vertices (n, 3) and faces (m, 3) of visible rock and furniture, by geom name (m, mine frame).

    What beams pass is left out, see `stops_beams`. The visible floor lies up to a decimetre above the flat floor that
    wheels stand on, and a range to it would measure a floor that no robot feels.
    """
    spec = world.spec()
    seen = [g for g in spec.geoms if g.group == GeomGroup.ROUGH_SURFACE and g.type == mujoco.mjtGeom.mjGEOM_MESH]
    shown = [g for g in seen if stops_beams(g.meshname)]
    meshes = {g.name: world.mesh(spec.mesh(g.meshname).file) for g in shown}
    return {name: (mesh.vertices, mesh.faces) for name, mesh in meshes.items()}


def collision_meshes(world: World) -> Meshes:
    """Return the hulls of the collision parts, vertices (n, 3) and faces (m, 3), by geom name (m, mine frame)."""
    model = world.compile(world.spec())
    meshes: Meshes = {}
    for geom in (model.geom(number) for number in range(model.ngeom)):
        if not is_rock(geom.name):
            continue
        mesh, turn = model.mesh(int(geom.dataid[0])), np.zeros(9)
        mujoco.mju_quat2Mat(turn, geom.quat)
        own = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]].astype(np.float64)
        faces = model.mesh_face[mesh.faceadr[0] : mesh.faceadr[0] + mesh.facenum[0]]
        meshes[geom.name] = rotate_inverse(own, turn.reshape(3, 3).T) + geom.pos, faces.copy()
    return meshes


def shared_lidar(folder: Path, world_sha256: str, range_m: float, backend: Backend) -> Lidar:
    """Return what casts the beams of a world, made once a process.

    Raises
    ------
    ValueError
        If the backend is unknown.
    """
    _require_known(backend)
    return _shared_lidar(folder, world_sha256, range_m, backend)


def _require_known(backend: object) -> None:
    if not isinstance(backend, str) or backend not in ("auto", *_MODULES):
        raise ValueError(f"lidar = {backend!r}: want auto, {', '.join(_MODULES)}")


@functools.lru_cache(maxsize=8)
def _shared_lidar(folder: Path, world_sha256: str, range_m: float, backend: Backend) -> Lidar:
    world = checked_world(folder, world_sha256)
    if world.volume is not None:
        from minexplore.sensing.facet_meshes import volume_meshes

        return Lidar(volume_meshes(world, world.volume.facets), range_m, backend, floor_m=-np.inf)
    if has_visible_rock(world.record):
        return Lidar(surface_meshes(world), range_m, backend)
    return Lidar(collision_meshes(world), range_m, backend, roof_m=world.record["height_m"])


class Lidar:
    """Casts rays of the mine frame against rock and, at `floor_m` and `roof_m`, a level floor and roof.

    A scene holds the rock within range of one tile.
    Scenes are made when a ray starts in their tile, and kept while all of them take less than `scenes_bytes`.
    """

    def __init__(
        self,
        meshes: Meshes,
        range_m: float,
        backend: Backend = "auto",
        scenes_bytes: int = _SCENES_BYTES,
        roof_m: float = np.inf,
        floor_m: float = 0.0,
    ) -> None:
        """Take the rock's meshes; `auto` takes the fastest backend that is installed.

        Raises
        ------
        ImportError
            If the backend is not installed, or none is.
        """
        installed = [name for name, module in _MODULES.items() if find_spec(module)]
        _require_known(backend)
        if backend != "auto" and backend not in installed:
            raise ImportError(f"lidar = {backend!r} needs {_MODULES[backend]}: pip install {_MODULES[backend]}")
        if not installed:
            raise ImportError("the robots' beams need Embree: pip install embreex, or open3d where it has no wheel")
        self.backend = installed[0] if backend == "auto" else backend
        self.range_m, self._floor_m, self._roof_m = range_m, floor_m, roof_m
        self._meshes, self._scenes_bytes = list(meshes.values()), scenes_bytes
        bounds = np.array([(v[:, :2].min(axis=0), v[:, :2].max(axis=0)) for v, _ in meshes.values()])
        self._low, self._high = np.moveaxis(bounds.reshape(-1, 2, 2), 1, 0)
        *first, faces = np.cumsum([0, *(len(faces) for _, faces in self._meshes)]).tolist()
        self._first = np.array(first, dtype=np.int32)  # plane of each mesh
        self._planes = np.empty((faces, 4))  # of a mesh when a scene first holds it: a robot sees a part of a mine
        self._has_planes = np.zeros(len(first), dtype=bool)
        self._scenes: OrderedDict[Tile, tuple[Cast, np.ndarray, int]] = OrderedDict()  # with first faces and bytes

    def cast(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return ranges (n, beams) m, at most `range_m`, of unit rays (n, beams, 3) from (n, 3)."""
        slope, height, beams = directions[..., 2], origins[:, None, 2], directions.shape[1]
        level = np.full(slope.shape, self.range_m)
        np.divide(self._floor_m - height, slope, out=level, where=slope < 0)
        if self._roof_m < np.inf:
            np.divide(self._roof_m - height, slope, out=level, where=slope > 0)
        starts = origins if len(origins) == 1 else origins.repeat(beams, axis=0)
        rock = self._to_rock(origins, starts, directions.reshape(-1, 3), beams).reshape(slope.shape)
        return np.minimum(np.minimum(rock, level), self.range_m)

    def _to_rock(self, origins: np.ndarray, starts: np.ndarray, ways: np.ndarray, beams: int) -> np.ndarray:
        """Return distances (n * beams,) m to rock, inf where there is none, along rays from origins (n, 3) m.

        Rays (n * beams, 3) start at `starts`, (n * beams, 3) m or a single one (1, 3).
        """
        found, face = self._hit_faces_by_tile(origins, starts, ways, beams)
        return plane_distances(self._planes, face, starts, ways, found) if len(self._planes) else found

    def _hit_faces_by_tile(
        self, origins: np.ndarray, starts: np.ndarray, ways: np.ndarray, beams: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return what `hits` does, of rays whose origins (n, 3) m are in any tiles; see `_to_rock`."""
        if len(origins) == 1:
            return self._hit_faces(tile_at(origins[0, :2], _TILE_M), starts, ways)
        groups = group_by_tile(tiles_at(origins[:, :2], _TILE_M))
        if len(groups) == 1:
            return self._hit_faces(groups[0][0], starts, ways)
        found, face = np.empty((len(origins), beams), np.float32), np.empty((len(origins), beams), np.int32)
        by_robot, their_ways = starts.reshape(-1, beams, 3), ways.reshape(-1, beams, 3)
        for tile, rows in groups:
            hit = self._hit_faces(tile, by_robot[rows].reshape(-1, 3), their_ways[rows].reshape(-1, 3))
            found[rows], face[rows] = (each.reshape(-1, beams) for each in hit)
        return found.ravel(), face.ravel()

    def hits(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return distances (n,) float32 m to rock, inf for no hit, and the number (n,) of each hit face, else -1.

        The rays (n, 3) float32 start at one place (3,) m, or at places (n, 3) m about the first one's tile. Distances
        are the caster's own, in single precision, and not cut at `range_m`; level floors and roofs are left out.
        """
        return self._hit_faces(tile_at(origins.reshape(-1, 3)[0, :2], _TILE_M), origins, directions)

    def _hit_faces(self, tile: Tile, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what `hits` does, of rays that start in a tile."""
        cast, first = self._scene(tile)
        if len(first) == 1:  # no mesh is near
            return np.full(len(directions), np.inf, np.float32), np.full(len(directions), -1, np.int32)
        found, mesh, face = cast(origins, directions)
        return found, first[mesh] + face

    @property
    def planes(self) -> np.ndarray:
        """Return the planes (n, 4) of all faces, see `face_planes`."""
        self._make_planes(np.flatnonzero(~self._has_planes))
        return self._planes

    @property
    def kept_bytes(self) -> int:
        """Return what the kept scenes take, by the number of their faces."""
        return sum(size for *_, size in self._scenes.values())

    def _scene(self, tile: Tile) -> tuple[Cast, np.ndarray]:
        """Return what casts rays that start in a tile, and the first face (k + 1,) of each mesh that it holds.

        The last number is for a miss, whose numbers of mesh and face are -1.
        """
        if tile not in self._scenes:
            low = np.array(tile) * _TILE_M - self.range_m
            high = low + _TILE_M + 2 * self.range_m
            near = np.flatnonzero(((self._low <= high) & (self._high >= low)).all(axis=1))
            meshes = [self._meshes[i] for i in near]
            size = _BYTES_PER_FACE[self.backend] * sum(len(faces) for _, faces in meshes)
            while self._scenes and self.kept_bytes + size > self._scenes_bytes:
                self._scenes.popitem(last=False)
            self._make_planes(near[~self._has_planes[near]])
            first = np.append(self._first[near], np.int32(0))
            self._scenes[tile] = (_BUILDERS[self.backend](meshes, (low + high) / 2), first, size)
        self._scenes.move_to_end(tile)
        return self._scenes[tile][:2]

    def _make_planes(self, meshes: np.ndarray) -> None:
        """Fill in the planes of some meshes (k,), by number."""
        for number in meshes.tolist():
            planes = face_planes(*self._meshes[number])
            self._planes[self._first[number] : self._first[number] + len(planes)] = planes
        self._has_planes[meshes] = True


def _embree(meshes: list[tuple[np.ndarray, np.ndarray]], centre: np.ndarray) -> Cast:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    middle = np.array([*centre, 0.0])  # rays are cast in 32 bits: the nearer to zero the better
    scene = EmbreeScene()
    for vertices, faces in meshes:
        TriangleMesh(scene, (vertices - middle).astype(np.float32), np.ascontiguousarray(faces, dtype=np.int32))

    def cast(origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        starts = np.empty(directions.shape, np.float32)
        starts[:] = origins - middle
        hit = scene.run(starts, np.ascontiguousarray(directions, dtype=np.float32), output=1)
        found, mesh = hit["tfar"], hit["geomID"]
        found[mesh < 0] = np.inf
        return found, mesh, hit["primID"]

    return cast


def _open3d(meshes: list[tuple[np.ndarray, np.ndarray]], centre: np.ndarray) -> Cast:
    import open3d

    tensor: Any = open3d.core.Tensor
    middle = np.array([*centre, 0.0])
    scene = open3d.t.geometry.RaycastingScene()
    for vertices, faces in meshes:
        scene.add_triangles(tensor((vertices - middle).astype(np.float32)), tensor(faces.astype(np.uint32)))

    def cast(origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        starts = np.broadcast_to(origins - middle, directions.shape)
        rays = np.concatenate([starts, directions], axis=1).astype(np.float32)
        hit = scene.cast_rays(tensor(rays))
        # Open3D numbers what was missed with the largest unsigned number, which becomes -1.
        mesh, face = (hit[name].numpy().astype(np.int32) for name in ("geometry_ids", "primitive_ids"))
        return hit["t_hit"].numpy(), mesh, face

    return cast


_BUILDERS: dict[str, Callable[[list[tuple[np.ndarray, np.ndarray]], np.ndarray], Cast]] = {
    "embree": _embree,
    "open3d": _open3d,
}
