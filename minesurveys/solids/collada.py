"""Reader of Collada (.dae), as modelling programs write it: meshes, placed by the nodes of the scene.

pycollada, which trimesh uses, keeps 32 bits of a number: steps of 0.5 m in coordinates of a national grid. Neither unit
nor axis is applied. So the numbers are read here: findings/collada-coordinates-of-32-bits.sh,
findings/collada-unit-and-axis-not-applied.sh.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from minesurveys.errors import InputError
from minesurveys.guard.plain_xml import plain_name, read_plain_xml
from minesurveys.limits import reader_limits
from minesurveys.remarks import warn_user
from minesurveys.solids.collada_faces import Named, faces_of, numbers
from minesurveys.solids.stated_metres import LayerMesh, StatedMeshes

COLLADA = ".dae"
_UP = {"X_UP": "x", "Y_UP": "y", "Z_UP": "z"}
_MOVES = ("matrix", "translate", "rotate", "scale", "lookat", "skew")


@dataclass
class _Document:
    """A file's elements by their kinds and identifiers, and what was met that is not read."""

    path: Path
    by_id: Named
    left_out: dict[str, int]
    placed: int = 0


def read_collada(path: Path, data: bytes) -> StatedMeshes:
    """Read the meshes of a Collada file in the places that its scene gives them, each a layer by its node's name.

    The unit (`<unit meter="...">`; a metre where none is stated) and the axis that points up (`<up_axis>`; y where none
    is stated) are those of the file. Polygons need not be convex. Nothing outside the file is read.

    Raises
    ------
    InputError
        If the file is no Collada, its scene is broken, or it has no mesh.

    References
    ----------
    Khronos, COLLADA 1.4.1 and 1.5, elements asset, node, instance_geometry, mesh.
    """
    root = read_plain_xml(path, data)
    if plain_name(root) != "COLLADA":
        raise InputError(f"{path}: an XML file of {plain_name(root)[:40]!r}, no Collada")
    document = _Document(path, {(plain_name(e), e.get("id", "")): e for e in root.iter() if e.get("id")}, {})
    scene = _child(_child(root, "scene"), "instance_visual_scene")
    start = (
        document.by_id.get(("visual_scene", (scene.get("url") or "").removeprefix("#"))) if scene is not None else None
    )
    if start is None:
        raise InputError(f"{path}: names no scene (<scene><instance_visual_scene>); export the scene, not its library")
    found = [mesh for node in start if plain_name(node) == "node" for mesh in _meshes(document, node, np.eye(4), 0)]
    asset = _child(root, "asset")
    unit, axis = _child(asset, "unit"), _child(asset, "up_axis")
    metres = 1.0 if unit is None else numbers(path, unit.get("meter", "1"), "<unit meter>", 1)[0]
    up = _UP.get((axis.text or "").strip() if axis is not None else "Y_UP")
    if up is None:
        raise InputError(f"{path}: <up_axis> is {(axis.text or '')[:20]!r}; want X_UP, Y_UP or Z_UP")  # type: ignore[union-attr]
    if up == "x":  # right is -y and towards the viewer is z
        found = [mesh._replace(vertices=mesh.vertices[:, [1, 2, 0]] * [-1, -1, 1]) for mesh in found]
    if document.left_out:
        listed = ", ".join(f"{count} of {name}" for name, count in sorted(document.left_out.items()))
        warn_user(f"its scene holds what is not read: {listed}", of=path.name)
    return StatedMeshes(found, float(metres), "y" if up == "y" else "z")


def _child(element: Element | None, name: str) -> Element | None:
    return None if element is None else next((child for child in element if plain_name(child) == name), None)


def _meshes(document: _Document, node: Element, above: np.ndarray, depth: int) -> Iterator[LayerMesh]:
    """Yield the meshes of a node and of those below it; `above` (4, 4) places the node's parent."""
    document.placed += 1
    limits = reader_limits()
    if depth > limits.nesting or document.placed > limits.shapes:
        raise InputError(
            f"{document.path}: its scene has nodes within nodes without an end, or more than {limits.shapes:,}"
        )
    place = above
    for child in node:
        kind = plain_name(child)
        if kind in _MOVES:
            place = place @ _moved(document.path, child, kind)
        elif kind == "node":
            yield from _meshes(document, child, place, depth + 1)
        elif kind == "instance_node":
            yield from _meshes(document, _named(document, child, "node"), place, depth + 1)
        elif kind == "instance_geometry":
            yield from _placed(document, node, _named(document, child, "geometry"), place)
        elif kind.startswith("instance_"):
            name = kind.removeprefix("instance_")
            document.left_out[name] = document.left_out.get(name, 0) + 1


def _named(document: _Document, instance: Element, kind: str) -> Element:
    url = instance.get("url") or ""
    found = document.by_id.get((kind, url[1:])) if url.startswith("#") else None
    if found is None:
        raise InputError(
            f"{document.path}: its scene names {url[:80]!r}, which is not in the file; export it as one file"
        )
    return found


def _placed(document: _Document, node: Element, geometry: Element, place: np.ndarray) -> Iterator[LayerMesh]:
    mesh = _child(geometry, "mesh")
    name = (node.get("name") or node.get("id") or geometry.get("name") or "mesh")[:200]
    if mesh is None:
        document.left_out["geometry without a mesh"] = document.left_out.get("geometry without a mesh", 0) + 1
        return
    vertices, faces = faces_of(document.path, mesh, document.by_id)
    if len(faces):
        vertices = vertices @ place[:3, :3].T + place[:3, 3]
        is_mirror = np.linalg.det(place[:3, :3]) < 0
        yield LayerMesh(name, vertices, faces[:, ::-1] if is_mirror else faces)


def _moved(path: Path, element: Element, kind: str) -> np.ndarray:
    """Return the matrix (4, 4) of a transformation."""
    found = np.eye(4)
    if kind == "matrix":
        found = numbers(path, element.text, "<matrix>", 16).reshape(4, 4)
    elif kind == "translate":
        found[:3, 3] = numbers(path, element.text, "<translate>", 3)
    elif kind == "scale":
        found[:3, :3] = np.diag(numbers(path, element.text, "<scale>", 3))
    elif kind == "rotate":
        x, y, z, degrees = numbers(path, element.text, "<rotate>", 4)
        axis = np.array([x, y, z]) / (np.linalg.norm([x, y, z]) or 1.0)
        cross = np.cross(np.eye(3), axis)
        found[:3, :3] += np.sin(np.radians(degrees)) * cross + (1 - np.cos(np.radians(degrees))) * cross @ cross
    else:
        raise InputError(
            f"{path}: <{kind}> places a mesh, which is not read; apply the transformations before the export"
        )
    return found
