"""Readers of triangle meshes: OBJ, STL and GLB by trimesh, DXF by ezdxf, PLY, and Surpac's triangulations."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
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

from pipeline.errors import InputError
from pipeline.params.survey import Unit
from pipeline.scans.ply_meshes import read_ply_mesh
from pipeline.scans.polygons import triangles_of, with_triangles
from pipeline.survey.solids.surpac_solid import read_dtm
from pipeline.survey.vector.dxf import READING_ERRORS
from pipeline.survey.vector.dxf_polylines import drop_frame_points, mesh_of_polygon_mesh, unit_of

_Y_UP = (".glb",)  # by the format's own rule; the others state nothing


@dataclass(frozen=True)
class Triangles:
    """The triangles of a file: `vertices` (n, 3) in its unit, `faces` (m, 3), and the layer (m,) of each.

    `unit` is None where the file states none; `up` is the axis that points up by the format's rule.
    """

    vertices: np.ndarray
    faces: np.ndarray
    layer: np.ndarray
    layers: tuple[str, ...]
    unit: Unit | None
    up: str


def read_triangles(path: Path, data: bytes, layers: list[str] | None = None) -> Triangles:
    """Read the triangles of a file's layers; None reads all.

    Raises
    ------
    InputError
        If the file is no mesh of its format, has no triangle, a coordinate is not finite, or a layer is unknown.
    """
    suffix, dxf_unit = path.suffix.lower(), None
    match suffix:
        case ".dxf":
            found, dxf_unit = _read_dxf(path)
        case ".dtm":
            found = read_dtm(path)
        case ".ply":
            found = [_read_ply(path, data)]
        case _:
            found = list(_scene_meshes(path, data, suffix))
    names = tuple(dict.fromkeys(name for name, _, _ in found))
    unknown = sorted(set(layers or []) - set(names))
    if unknown:
        raise InputError(f"{path}: no layer {', '.join(unknown)}; there are {', '.join(names) or 'none'}")
    chosen = [mesh for mesh in found if layers is None or mesh[0] in layers]
    if not sum(len(faces) for _, _, faces in chosen):
        raise InputError(f"{path}: has no triangles; a mesh of the workings is wanted")
    first = np.cumsum([0, *(len(vertices) for _, vertices, _ in chosen)])
    vertices = np.concatenate([vertices for _, vertices, _ in chosen])
    if any(faces.min(initial=0) < 0 or faces.max(initial=-1) >= len(own) for _, own, faces in chosen):
        raise InputError(f"{path}: a triangle of a corner that the file does not have")
    if not np.isfinite(vertices).all():
        raise InputError(f"{path}: a coordinate that is no finite number")
    faces = np.concatenate([faces + start for (_, _, faces), start in zip(chosen, first[:-1], strict=True)])
    layer = np.repeat([names.index(name) for name, _, _ in chosen], [len(faces) for _, _, faces in chosen])
    unit: Unit | None = "m" if suffix in _Y_UP else dxf_unit
    return Triangles(vertices, faces, layer, names, unit, "y" if suffix in _Y_UP else "z")


Mesh = tuple[str, np.ndarray, np.ndarray]


def _scene_meshes(path: Path, data: bytes, suffix: str) -> Iterator[Mesh]:
    """Yield name, vertices and faces of each mesh of a file that trimesh reads; it opens no other file."""
    try:
        if suffix == ".obj":
            data = with_triangles(data)
        scene = trimesh.load_scene(io.BytesIO(data), file_type=suffix[1:], resolver=None, process=False)
        placed = [(name, *scene.graph[name]) for name in scene.graph.nodes_geometry]
        meshes = [(name, transform, scene.geometry[key]) for name, transform, key in placed]
    except Exception as error:  # trimesh raises what its parsers raise
        raise InputError(f"{path}: not a mesh that a {suffix[1:].upper()} file holds") from error
    for name, transform, mesh in meshes:
        if isinstance(mesh, trimesh.Trimesh):
            if np.shape(mesh.vertices)[1:] != (3,):
                raise InputError(f"{path}: corners of {np.shape(mesh.vertices)[1]} numbers, want 3")
            vertices = np.asarray(mesh.vertices, np.float64) @ transform[:3, :3].T + transform[:3, 3]
            faces = np.asarray(mesh.faces, np.int64)
            yield str(name), vertices, faces[:, ::-1] if np.linalg.det(transform[:3, :3]) < 0 else faces  # a mirror


def _read_ply(path: Path, data: bytes) -> Mesh:
    try:
        vertices, faces, _ = read_ply_mesh(data)
    except (ValueError, KeyError, IndexError, Warning) as error:
        raise InputError(f"{path}: not a mesh that a PLY file holds, or cut off") from error
    return path.stem, vertices, faces


def _read_dxf(path: Path) -> tuple[list[Mesh], Unit | None]:
    """Return the meshes of a drawing, and the unit that it states."""
    try:
        drawing = readfile(path)
        drop_frame_points(drawing)
        return list(_dxf_meshes(drawing)), unit_of(path, drawing)
    except OSError as error:
        raise InputError(f"{path}: not a DXF drawing; does it begin with the section HEADER or ENTITIES?") from error
    except READING_ERRORS as error:
        raise InputError(f"{path}: not a DXF drawing that can be read") from error


def _dxf_meshes(drawing: Drawing) -> Iterator[Mesh]:
    """Yield layer, vertices and triangles of each 3DFACE, polyface or polygon mesh, and MESH of a drawing."""
    for entity in disassemble.recursive_decompose(drawing.modelspace()):
        mesh = _dxf_mesh(entity)
        if mesh is not None and len(mesh.faces):
            vertices = np.array([tuple(vertex) for vertex in mesh.vertices], np.float64).reshape(-1, 3)
            faces = [list(dict.fromkeys(face)) for face in mesh.faces]  # corners may repeat
            sizes = np.array([len(face) for face in faces], np.int64)
            yield str(entity.dxf.layer), vertices, triangles_of(vertices, np.concatenate(faces).astype(np.int64), sizes)


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
