"""Readers of OBJ, STL and GLB by trimesh, and of PLY: meshes whose formats state no unit, but GLB's."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from minesurveys.coordinates.precision import steps_of_floats
from minesurveys.errors import InputError
from minesurveys.solids.ply_meshes import read_ply_mesh
from minesurveys.solids.polygons import with_triangles
from minesurveys.solids.stated_metres import LayerMesh, StatedMeshes, metres_in_comments

_STL_HEAD = 84  # bytes before the first triangle of a binary STL file
_GLB = ".glb"  # in metres and with y up, by the format's own rule
_GLB_HEAD, _GLB_CHUNK = 12, 20  # bytes before the length of a GLB file's JSON, and before that JSON
_QUANTIZED = "KHR_mesh_quantization"
_FAN = 6  # mode of a primitive of glTF
_OF_LOOKS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_")  # extensions that move no corner


def read_scene(path: Path, data: bytes) -> StatedMeshes:
    """Read each mesh of an OBJ, STL or GLB file, placed as its scene places it; `InputError` if it is none."""
    suffix = path.suffix.lower()
    found = list(_scene_meshes(path, data, suffix))
    return (
        StatedMeshes(found, 1.0, "y") if suffix == _GLB else StatedMeshes(found, metres_in_comments(path, data, suffix))
    )


def read_ply(path: Path, data: bytes) -> StatedMeshes:
    """Read the mesh of a PLY file; `InputError` if it holds none, or is cut off."""
    try:
        vertices, faces, is_single = read_ply_mesh(data)
    except (ValueError, KeyError, IndexError, Warning) as error:
        raise InputError(f"{path}: not a mesh that a PLY file holds, or cut off") from error
    mesh = LayerMesh(path.stem, vertices, faces, steps_of_floats(vertices) if is_single else np.zeros(3))
    return StatedMeshes([mesh], metres_in_comments(path, data, ".ply"))


def _scene_meshes(path: Path, data: bytes, suffix: str) -> Iterator[LayerMesh]:
    """Yield name, vertices and faces of each mesh of a file that trimesh reads; it opens no other file."""
    if suffix == _GLB:
        _require_plain_corners(path, data)
    try:
        if suffix == ".obj":
            data = with_triangles(data)
        scene = trimesh.load_scene(io.BytesIO(data), file_type=suffix[1:], resolver=None, process=False)
        placed = [(name, *scene.graph[name]) for name in scene.graph.nodes_geometry]
        meshes = [(name, transform, scene.geometry[key]) for name, transform, key in placed]
    except Exception as error:  # trimesh raises what its parsers raise
        raise InputError(f"{path}: not a mesh that a {suffix[1:].upper()} file holds") from error
    is_single = suffix == _GLB or (suffix == ".stl" and _is_binary_stl(data))
    for name, transform, mesh in meshes:
        if isinstance(mesh, trimesh.Trimesh):
            if np.shape(mesh.vertices)[1:] != (3,):
                raise InputError(f"{path}: corners of {np.shape(mesh.vertices)[1]} numbers, want 3")
            vertices = np.asarray(mesh.vertices, np.float64) @ transform[:3, :3].T + transform[:3, 3]
            faces = np.asarray(mesh.faces, np.int64)
            faces = faces[:, ::-1] if np.linalg.det(transform[:3, :3]) < 0 else faces  # a mirror
            steps = np.abs(transform[:3, :3]) @ steps_of_floats(mesh.vertices) if is_single else np.zeros(3)
            yield LayerMesh(str(name), vertices, faces, steps)


def _require_plain_corners(path: Path, data: bytes) -> None:
    """Refuse a GLB file whose corners or faces trimesh would read elsewhere or not at all.

    glTF 2.0, section 3.12: a file that requires an extension is not to be loaded without it. See
    findings/trimesh-glb-shares-as-metres.sh and findings/trimesh-glb-sparse-corners-at-the-origin.sh.
    """
    try:
        size = int.from_bytes(data[_GLB_HEAD : _GLB_HEAD + 4], "little")
        stated: dict[str, Any] = json.loads(data[_GLB_CHUNK : _GLB_CHUNK + size])
        needed = [str(name) for name in stated.get("extensionsRequired", []) if not str(name).startswith(_OF_LOOKS)]
        used = [part["attributes"]["POSITION"] for mesh in stated.get("meshes", []) for part in mesh["primitives"]]
        accessors = [stated["accessors"][number] for number in used]
        shares, sparse = any(one.get("normalized") for one in accessors), any("sparse" in one for one in accessors)
        fans = any(part.get("mode") == _FAN for mesh in stated.get("meshes", []) for part in mesh["primitives"])
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError):
        return  # trimesh says what is wrong
    unread = [name for name in needed if name != _QUANTIZED]
    for is_there, what in (
        (fans, "triangle fans"),
        (sparse, "sparse corners"),
        (shares, "shares of integers as corners"),
    ):
        unread = [what] if is_there else unread
    if unread:
        raise InputError(
            f"{path}: its meshes need {unread[0]}, which is not read; export it as plain triangles without compression "
            "or quantization"
        )


def _is_binary_stl(data: bytes) -> bool:
    """Return whether an STL file is as long as its number of triangles says, 50 bytes each."""
    return len(data) == _STL_HEAD + 50 * int.from_bytes(data[_STL_HEAD - 4 : _STL_HEAD], "little")
