"""Readers of triangle meshes: OBJ, STL, PLY and GLB by trimesh, DXF by ezdxf, and others in modules of their own."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from ezdxf import disassemble
from ezdxf.entities.dxfentity import DXFEntity
from ezdxf.entities.mesh import Mesh as MeshEntity
from ezdxf.entities.polyline import Polyface, Polymesh
from ezdxf.entities.solid import Face3d
from ezdxf.filemanagement import readfile
from ezdxf.render.mesh import MeshBuilder

from pipeline.errors import InputError
from pipeline.params.survey import Unit
from pipeline.survey.solids.collada import COLLADA, read_collada
from pipeline.survey.solids.landxml import LANDXML, read_landxml
from pipeline.survey.solids.mining_format import OMF, read_omf
from pipeline.survey.solids.stated_metres import StatedMeshes, in_named_unit
from pipeline.survey.solids.surpac_solid import read_dtm
from pipeline.survey.solids.usd import USD, read_usd
from pipeline.survey.vector.dxf import READING_ERRORS

DXF = ".dxf"
_UNITS: dict[int, Unit] = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m"}  # $INSUNITS
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
    suffix = path.suffix.lower()
    stated = _stated_meshes(path, data, suffix)
    match suffix:
        case _ if stated is not None:
            found = stated.meshes
        case ".dxf":
            found = _read_dxf(path)
        case ".dtm":
            found = read_dtm(path)
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
    if stated is not None:
        return Triangles(vertices, faces, layer, names, stated.unit, stated.up)
    unit: Unit | None = _dxf_unit(path) if suffix == DXF else "m" if suffix in _Y_UP else None
    return Triangles(vertices, faces, layer, names, unit, "y" if suffix in _Y_UP else "z")


Mesh = tuple[str, np.ndarray, np.ndarray]


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


def _scene_meshes(path: Path, data: bytes, suffix: str) -> Iterator[Mesh]:
    """Yield name, vertices and faces of each mesh of a file that trimesh reads; it opens no other file."""
    try:
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


def _read_dxf(path: Path) -> list[Mesh]:
    try:
        return list(_dxf_meshes(path))
    except OSError as error:
        raise InputError(f"{path}: not a DXF drawing; does it begin with the section HEADER or ENTITIES?") from error
    except READING_ERRORS as error:
        raise InputError(f"{path}: not a DXF drawing that can be read") from error


def _dxf_meshes(path: Path) -> Iterator[Mesh]:
    """Yield layer, vertices and triangles of each 3DFACE, polyface or polygon mesh, and MESH of a drawing."""
    for entity in disassemble.recursive_decompose(readfile(path).modelspace()):
        mesh = _dxf_mesh(entity)
        if mesh is not None and len(mesh.faces):
            mesh.faces = [face for face in mesh.faces if len(set(face)) > 2]
            plain = mesh.mesh_tessellation(max_vertex_count=3)
            vertices = np.array([tuple(vertex) for vertex in plain.vertices], np.float64).reshape(-1, 3)
            yield str(entity.dxf.layer), vertices, np.array(plain.faces, np.int64).reshape(-1, 3)


def _dxf_mesh(entity: DXFEntity) -> MeshBuilder | None:
    if isinstance(entity, Face3d):
        mesh = MeshBuilder()
        mesh.add_face(list(dict.fromkeys(entity.wcs_vertices())))
        return mesh
    if isinstance(entity, MeshEntity):
        return MeshBuilder.from_mesh(entity)
    if isinstance(entity, Polyface | Polymesh):
        return MeshBuilder.from_polyface(entity)
    return None


def _dxf_unit(path: Path) -> Unit | None:
    return _UNITS.get(int(readfile(path).header.get("$INSUNITS", 0)))
