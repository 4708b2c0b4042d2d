"""Meshes of a DXF drawing, by ezdxf."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from ezdxf import disassemble
from ezdxf.document import Drawing
from ezdxf.entities.dxfentity import DXFEntity
from ezdxf.entities.mesh import Mesh as MeshEntity
from ezdxf.entities.polyline import Polyface, Polymesh
from ezdxf.entities.solid import Face3d
from ezdxf.filemanagement import readfile
from ezdxf.render.mesh import MeshBuilder

from minesurveys.errors import InputError
from minesurveys.frames import METRES
from minesurveys.solids.polygons import triangles_of
from minesurveys.solids.stated_metres import LayerMesh, StatedMeshes
from minesurveys.vector.dxf import READING_ERRORS
from minesurveys.vector.dxf_polylines import drop_frame_points, mesh_of_polygon_mesh, unit_of


def read_dxf_meshes(path: Path, _data: bytes) -> StatedMeshes:
    """Read the meshes of a drawing, each with its layer, and the unit that it states; `InputError` if it is none."""
    try:
        drawing = readfile(path)
        drop_frame_points(drawing)
        unit = unit_of(path, drawing)
        return StatedMeshes(list(_dxf_meshes(drawing)), None if unit is None else METRES[unit])
    except OSError as error:
        raise InputError(f"{path}: not a DXF drawing; does it begin with the section HEADER or ENTITIES?") from error
    except READING_ERRORS as error:
        raise InputError(f"{path}: not a DXF drawing that can be read") from error


def _dxf_meshes(drawing: Drawing) -> Iterator[LayerMesh]:
    """Yield layer, vertices and triangles of each 3DFACE, polyface or polygon mesh, and MESH of a drawing."""
    for entity in disassemble.recursive_decompose(drawing.modelspace()):
        mesh = _dxf_mesh(entity)
        if mesh is not None and len(mesh.faces):
            vertices = np.array([tuple(vertex) for vertex in mesh.vertices], np.float64).reshape(-1, 3)
            faces = [list(dict.fromkeys(face)) for face in mesh.faces]  # corners may repeat
            sizes = np.array([len(face) for face in faces], np.int64)
            triangles = triangles_of(vertices, np.concatenate(faces).astype(np.int64), sizes)
            yield LayerMesh(str(entity.dxf.layer), vertices, triangles)


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
