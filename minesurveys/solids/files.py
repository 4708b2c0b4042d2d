"""Readers of triangle meshes: OBJ, STL and GLB by trimesh, DXF by ezdxf, PLY, and others in modules of their own."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import trimesh
from ezdxf import disassemble
from ezdxf.document import Drawing
from ezdxf.entities.dxfentity import DXFEntity
from ezdxf.entities.mesh import Mesh as MeshEntity
from ezdxf.entities.polyline import Polyface, Polymesh
from ezdxf.entities.solid import Face3d
from ezdxf.filemanagement import readfile
from ezdxf.render.mesh import MeshBuilder

from minesurveys.coordinates.precision import steps_of_floats
from minesurveys.errors import InputError
from minesurveys.solids.collada import COLLADA, read_collada
from minesurveys.solids.landxml import LANDXML, read_landxml
from minesurveys.solids.mining_format import OMF, read_omf
from minesurveys.solids.ply_meshes import read_ply_mesh
from minesurveys.solids.polygons import triangles_of, with_triangles
from minesurveys.solids.stated_metres import StatedMeshes, in_named_unit, unit_in_comments
from minesurveys.solids.surpac_solid import read_dtm
from minesurveys.solids.usd import USD, read_usd
from minesurveys.types import Unit
from minesurveys.vector.dxf import READING_ERRORS
from minesurveys.vector.dxf_polylines import drop_frame_points, mesh_of_polygon_mesh, unit_of

_STL_HEAD = 84  # bytes before the first triangle of a binary STL file
_COMMENTED = (".obj", ".ply", ".stl")
_Y_UP = (".glb",)  # by the format's own rule; the others state nothing


@dataclass(frozen=True)
class Triangles:
    """The triangles of a file: `vertices` (n, 3) in its unit, `faces` (m, 3), and the layer (m,) of each.

    `unit` is None where the file states none; `up` is the axis that points up by the format's rule. `steps` (3,) are
    those in which the format's numbers of 32 bits come, along each axis, and zero of other formats.
    """

    vertices: np.ndarray
    faces: np.ndarray
    layer: np.ndarray
    layers: tuple[str, ...]
    unit: Unit | None
    up: str
    steps: np.ndarray


@dataclass(frozen=True)
class _LayerMesh:
    """Triangles of one layer, and the steps (3,) in which its coordinates come, zero if they are as fine as written."""

    layer: str
    vertices: np.ndarray
    faces: np.ndarray
    steps: np.ndarray = field(default_factory=lambda: np.zeros(3))


def read_triangles(path: Path, data: bytes, layers: list[str] | None = None) -> Triangles:
    """Read the triangles of a file's layers; None reads all.

    Raises
    ------
    InputError
        If the file is no mesh of its format, has no triangle, a coordinate is not finite, or a layer is unknown.
    """
    suffix, dxf_unit = path.suffix.lower(), None
    stated = _stated_meshes(path, data, suffix)
    match suffix:
        case _ if stated is not None:
            found = [_LayerMesh(*mesh) for mesh in stated.meshes]
        case ".dxf":
            found, dxf_unit = _read_dxf(path)
        case ".dtm":
            found = [_LayerMesh(*mesh) for mesh in read_dtm(path)]
        case ".ply":
            found = [_read_ply(path, data)]
        case _:
            found = list(_scene_meshes(path, data, suffix))
    names = tuple(dict.fromkeys(mesh.layer for mesh in found))
    unknown = sorted(set(layers or []) - set(names))
    if unknown:
        raise InputError(f"{path}: no layer {', '.join(unknown)}; there are {', '.join(names) or 'none'}")
    chosen = [mesh for mesh in found if layers is None or mesh.layer in layers]
    if not sum(len(mesh.faces) for mesh in chosen):
        raise InputError(f"{path}: has no triangles; a mesh of the workings is wanted")
    if any(mesh.faces.min(initial=0) < 0 or mesh.faces.max(initial=-1) >= len(mesh.vertices) for mesh in chosen):
        raise InputError(f"{path}: a triangle of a corner that the file does not have")
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in chosen)])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(chosen, first[:-1], strict=True)])
    # A corner of no triangle, such as a mark at 0 0 0, is no part of the workings.
    used, faces = np.unique(faces, return_inverse=True)
    faces = faces.reshape(-1, 3).astype(np.int64)
    vertices = np.concatenate([mesh.vertices for mesh in chosen])[used]
    if not np.isfinite(vertices).all():
        raise InputError(f"{path}: a coordinate that is no finite number")
    layer = np.repeat([names.index(mesh.layer) for mesh in chosen], [len(mesh.faces) for mesh in chosen])
    steps = np.max([mesh.steps for mesh in chosen], axis=0)
    if stated is not None:
        return Triangles(vertices, faces, layer, names, stated.unit, stated.up, steps)
    unit: Unit | None = "m" if suffix in _Y_UP else dxf_unit
    if suffix in _COMMENTED:
        unit = unit_in_comments(path, data, suffix)
    return Triangles(vertices, faces, layer, names, unit, "y" if suffix in _Y_UP else "z", steps)


def _stated_meshes(path: Path, data: bytes, suffix: str) -> StatedMeshes | None:
    """Return the meshes of a file whose format states its unit and axis in words of its own, None of other formats."""
    if suffix in LANDXML:
        found = read_landxml(path, data)
    elif suffix == COLLADA:
        found = read_collada(path, data)
    elif suffix in USD:
        found = read_usd(path)
    elif suffix == OMF:
        found = read_omf(path)
    else:
        return None
    return in_named_unit(path, found)


def _scene_meshes(path: Path, data: bytes, suffix: str) -> Iterator[_LayerMesh]:
    """Yield name, vertices and faces of each mesh of a file that trimesh reads; it opens no other file."""
    try:
        if suffix == ".obj":
            data = with_triangles(data)
        scene = trimesh.load_scene(io.BytesIO(data), file_type=suffix[1:], resolver=None, process=False)
        placed = [(name, *scene.graph[name]) for name in scene.graph.nodes_geometry]
        meshes = [(name, transform, scene.geometry[key]) for name, transform, key in placed]
    except Exception as error:  # trimesh raises what its parsers raise
        raise InputError(f"{path}: not a mesh that a {suffix[1:].upper()} file holds") from error
    is_single = suffix in _Y_UP or (suffix == ".stl" and _is_binary_stl(data))
    for name, transform, mesh in meshes:
        if isinstance(mesh, trimesh.Trimesh):
            if np.shape(mesh.vertices)[1:] != (3,):
                raise InputError(f"{path}: corners of {np.shape(mesh.vertices)[1]} numbers, want 3")
            vertices = np.asarray(mesh.vertices, np.float64) @ transform[:3, :3].T + transform[:3, 3]
            faces = np.asarray(mesh.faces, np.int64)
            faces = faces[:, ::-1] if np.linalg.det(transform[:3, :3]) < 0 else faces  # a mirror
            steps = np.abs(transform[:3, :3]) @ steps_of_floats(mesh.vertices) if is_single else np.zeros(3)
            yield _LayerMesh(str(name), vertices, faces, steps)


def _read_ply(path: Path, data: bytes) -> _LayerMesh:
    try:
        vertices, faces, is_single = read_ply_mesh(data)
    except (ValueError, KeyError, IndexError, Warning) as error:
        raise InputError(f"{path}: not a mesh that a PLY file holds, or cut off") from error
    return _LayerMesh(path.stem, vertices, faces, steps_of_floats(vertices) if is_single else np.zeros(3))


def _is_binary_stl(data: bytes) -> bool:
    """Return whether an STL file is as long as its number of triangles says, 50 bytes each."""
    return len(data) == _STL_HEAD + 50 * int.from_bytes(data[_STL_HEAD - 4 : _STL_HEAD], "little")


def _read_dxf(path: Path) -> tuple[list[_LayerMesh], Unit | None]:
    """Return the meshes of a drawing, and the unit that it states."""
    try:
        drawing = readfile(path)
        drop_frame_points(drawing)
        return list(_dxf_meshes(drawing)), unit_of(path, drawing)
    except OSError as error:
        raise InputError(f"{path}: not a DXF drawing; does it begin with the section HEADER or ENTITIES?") from error
    except READING_ERRORS as error:
        raise InputError(f"{path}: not a DXF drawing that can be read") from error


def _dxf_meshes(drawing: Drawing) -> Iterator[_LayerMesh]:
    """Yield layer, vertices and triangles of each 3DFACE, polyface or polygon mesh, and MESH of a drawing."""
    for entity in disassemble.recursive_decompose(drawing.modelspace()):
        mesh = _dxf_mesh(entity)
        if mesh is not None and len(mesh.faces):
            vertices = np.array([tuple(vertex) for vertex in mesh.vertices], np.float64).reshape(-1, 3)
            faces = [list(dict.fromkeys(face)) for face in mesh.faces]  # corners may repeat
            sizes = np.array([len(face) for face in faces], np.int64)
            triangles = triangles_of(vertices, np.concatenate(faces).astype(np.int64), sizes)
            yield _LayerMesh(str(entity.dxf.layer), vertices, triangles)


def _dxf_mesh(entity: DXFEntity) -> MeshBuilder | None:
    if isinstance(entity, Face3d):
        mesh = MeshBuilder()
        mesh.add_face(list(dict.fromkeys(entity.wcs_vertices())))
        return mesh
    if isinstance(entity, MeshEntity):
        return MeshBuilder.from_mesh(entity)
    if isinstance(entity, Polyface):
        return MeshBuilder.from_polyface(entity)
    if isinstance(entity, Polymesh):
        return mesh_of_polygon_mesh(entity)
    return None
