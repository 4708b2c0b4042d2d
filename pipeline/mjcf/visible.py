"""The visible meshes of a level mine, which MuJoCo compiles a few at a time, and those of them in sight of a place.

A compiled model takes 460 to 750 bytes a face of them, and 1,100 while it is compiled; here a face takes 20.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import FITTINGS_BODY, SURFACE_BODY, GeomGroup, smooth_mesh, surface_geom
from pipeline.geometry.rasterize import fill_polygon
from pipeline.mjcf.loading import STAND_IN, compile_spec
from pipeline.types import Frame

_AT_ONCE = 40  # meshes, of tiles of 20 m
_HIDDEN = GeomGroup.SMOOTH_SURFACE  # no picture of a world with rough rock shows it
_ROCK_M = 1.0  # by which visible rock may stand behind the wall, and more
_CELL_M, _BEARINGS = 0.25, 3600  # of the plan in which lines of sight run
_BESIDE_M = 2.0  # of a line of sight: neighbours are 1.3 m apart at 750 m


@dataclass(frozen=True)
class VisibleMesh:
    """A mesh as MuJoCo has compiled it, which turns and moves it: corners (n, 3) m in 32 bits, faces (m, 3), pose."""

    group: int
    corners: np.ndarray
    faces: np.ndarray
    rotation: np.ndarray
    place_m: np.ndarray

    @property
    def vertices(self) -> np.ndarray:
        """Return the vertices (n, 3) m, mine frame."""
        placed: np.ndarray = self.corners.astype(np.float64) @ self.rotation.T + self.place_m
        return placed


Visible = Mapping[str, VisibleMesh]  # by the name of the geom, in the model's order


def compile_visible(spec: mujoco.MjSpec, path: Path) -> dict[str, VisibleMesh]:
    """Compile the meshes that are only seen, a few at a time, each as it would be in the whole model.

    Raises
    ------
    ArtifactError
        If MuJoCo refuses one; the message is MuJoCo's, on one line.
    """
    geoms, found = _only_seen(spec), dict[str, VisibleMesh]()
    for first in range(0, len(geoms), _AT_ONCE):
        some = geoms[first : first + _AT_ONCE]
        model = compile_spec(_spec_of(spec, some), path)
        found |= {geom.name: _compiled(model, k, geom.group) for k, geom in enumerate(some)}
    return found


def _only_seen(spec: mujoco.MjSpec) -> list[mujoco.MjsGeom]:
    """Return the geoms of meshes in files that only the bodies of the surface and the fittings have, and never touch.

    They are those that `pipeline.mjcf.bundle.obstacles` leaves out.
    """
    meshes = [geom for geom in spec.geoms if geom.type == mujoco.mjtGeom.mjGEOM_MESH]
    seen = [
        geom
        for geom in meshes
        if geom.parent.name in (SURFACE_BODY, FITTINGS_BODY) and not geom.contype and not geom.conaffinity
    ]
    names = {geom.name for geom in seen}
    touched = {geom.meshname for geom in meshes if geom.name not in names}
    return [geom for geom in seen if geom.meshname not in touched and spec.mesh(geom.meshname).file]


def _spec_of(spec: mujoco.MjSpec, geoms: list[mujoco.MjsGeom]) -> mujoco.MjSpec:
    """Return a specification of these geoms and their meshes alone."""
    some = mujoco.MjSpec()
    some.modelfiledir, some.meshdir = spec.modelfiledir, spec.meshdir
    meshes = {geom.meshname: spec.mesh(geom.meshname) for geom in geoms}
    some.assets = {mesh.file: spec.assets[mesh.file] for mesh in meshes.values() if mesh.file in spec.assets}
    for name, mesh in meshes.items():
        some.add_mesh(
            name=name,
            file=mesh.file,
            inertia=mesh.inertia,
            scale=mesh.scale,
            refpos=mesh.refpos,
            refquat=mesh.refquat,
            smoothnormal=mesh.smoothnormal,
        )
    for geom in geoms:
        some.worldbody.add_geom(
            name=geom.name, type=geom.type, meshname=geom.meshname, pos=geom.pos, quat=geom.quat, contype=0
        )
    return some


def _compiled(model: mujoco.MjModel, geom: int, group: int) -> VisibleMesh:
    mesh, rotation = model.geom_dataid[geom], np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    first, start = model.mesh_faceadr[mesh], model.mesh_vertadr[mesh]
    return VisibleMesh(
        group,
        model.mesh_vert[start : start + model.mesh_vertnum[mesh]].copy(),
        model.mesh_face[first : first + model.mesh_facenum[mesh]].copy(),
        rotation.reshape(3, 3),
        model.geom_pos[geom].copy(),
    )


def compile_with(spec: mujoco.MjSpec, path: Path, shown: Collection[str] = ()) -> mujoco.MjModel:
    """Compile a model whose visible meshes are hidden tetrahedra, except those of these geoms; `spec` is changed.

    Raises
    ------
    ArtifactError
        If MuJoCo refuses the model; the message is MuJoCo's, on one line.
    """
    hide_but(spec, shown)
    return compile_spec(spec, path)


def hide_but(spec: mujoco.MjSpec, shown: Collection[str]) -> None:
    """Make hidden tetrahedra of all visible meshes of a model but those of some geoms."""
    left_out = [geom for geom in _only_seen(spec) if geom.name not in shown]
    for geom in left_out:
        geom.group = _HIDDEN
    names = {geom.meshname for geom in left_out} - {geom.meshname for geom in spec.geoms if geom.name in shown}
    leave_out(spec.mesh(name) for name in names)


def leave_out(meshes: Iterable[mujoco.MjsMesh]) -> None:
    """Put a tetrahedron in the place of meshes: MuJoCo takes longer to remove one the more there are."""
    for mesh in meshes:
        mesh.file, mesh.uservert, mesh.userface = "", STAND_IN.vertices.ravel(), STAND_IN.faces.ravel()


def in_sight(visible: Visible, free: BaseGeometry, eyes_m: Iterable[np.ndarray]) -> set[str]:
    """Return the names of geoms that a camera at places (2,) m of the plan, in the workings, may see.

    Lines of sight run in plan to the walls, which visible rock may stand behind. Whatever is near one may be seen.
    """
    west, south, east, north = free.buffer(_ROCK_M).bounds
    cols, rows = (int(np.ceil(length / _CELL_M)) for length in (east - west, north - south))
    frame = Frame(1 / _CELL_M, -west / _CELL_M, north / _CELL_M, cols, rows)
    is_open = fill_polygon(free.buffer(_ROCK_M), frame)
    seen = [points for eye in eyes_m for points in _lines_of_sight(is_open, frame, eye)]
    cells = np.unique(np.floor(np.concatenate(seen) / _BESIDE_M), axis=0) * _BESIDE_M + _BESIDE_M / 2
    found = set()
    for name, mesh in visible.items():
        vertices = mesh.vertices[:, :2]
        low, high = vertices.min(axis=0) - 1.5 * _BESIDE_M, vertices.max(axis=0) + 1.5 * _BESIDE_M
        if mesh.group == GeomGroup.ROUGH_SURFACE and ((cells >= low) & (cells <= high)).all(axis=1).any():
            found.add(name)
    return found


def _lines_of_sight(is_open: np.ndarray, frame: Frame, eye_m: np.ndarray) -> Iterator[np.ndarray]:
    """Yield points (n, 2) m of lines of sight that begin at a place, farther and farther away."""
    bearing = np.linspace(0, 2 * np.pi, _BEARINGS, endpoint=False)
    ahead, reach_m = np.column_stack([np.cos(bearing), np.sin(bearing)]), 0.0
    while len(ahead):
        points = eye_m + reach_m * ahead
        yield points
        col, row = np.floor(frame.to_image(points)).astype(int).T
        inside = (col >= 0) & (col < frame.width_px) & (row >= 0) & (row < frame.height_px)
        inside[inside] = is_open[row[inside], col[inside]]
        ahead, reach_m = ahead[inside], reach_m + _CELL_M


def visible_triangles(visible: Visible, piece: str) -> np.ndarray:
    """Return the triangles (n, 3, 3), m, mine frame, of a visible piece: walls or roof.

    They belong to the rough surface, or to the smooth surface if the world has no rough one.
    """
    rough = _triangles(visible, surface_geom(piece))
    return rough if len(rough) else smooth_triangles(visible, piece)


def smooth_triangles(visible: Visible, piece: str) -> np.ndarray:
    """Return the triangles (n, 3, 3), m, mine frame, of a piece of the smooth surface."""
    return _triangles(visible, surface_geom(smooth_mesh(piece)))


def _triangles(visible: Visible, prefix: str) -> np.ndarray:
    found = [mesh.vertices[mesh.faces] for name, mesh in visible.items() if name.startswith(prefix)]
    return np.concatenate([np.zeros((0, 3, 3)), *found])
