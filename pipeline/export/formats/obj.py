"""Wavefront OBJ: what is seen with its materials, and what is touched, in the mine frame.

OBJ has neither frames nor friction. Comments at the head of each file state the frames, units, hash and licence as one
line of JSON.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import trimesh

from minexplore.bundle import ROCK_TEXTURE, ROOF_GEOM, TriangleMesh, floor_geom
from pipeline.errors import ArtifactError
from pipeline.export.frames import upwards
from pipeline.export.scene import (
    ConvexPart,
    ExportScene,
    Files,
    Material,
    ReadScene,
    Surface,
    WorldFacts,
    hull_of,
    placed_part,
)

_FACTS = "# world "
_NOTHING = np.zeros((0, 3))


class ObjText:
    """The text of an OBJ file in the making; numbers of vertices run through the whole file."""

    def __init__(self, head: str = "") -> None:
        self._pieces = [head]
        self._first = np.ones(3, np.int64)  # of places, texture coordinates and normals

    def add(self, name: str, group: str, material: str, mesh: TriangleMesh) -> None:
        """Add a mesh as an object in a group."""
        count = len(mesh.vertices)
        has_texture, has_normals = len(mesh.texcoords) == count, len(mesh.normals) == count
        lists = (("v", mesh.vertices, 6), ("vt", upwards(mesh.texcoords), 6), ("vn", mesh.normals, 4))
        used = (True, has_texture, has_normals)
        self._pieces.append(f"o {name}\ng {group}\n" + (f"usemtl {material}\n" if material else ""))
        for (key, values, digits), is_used in zip(lists, used, strict=True):
            if is_used:
                line = f"{key}{f' %.{digits}f' * values.shape[1]}\n"
                self._pieces.append((line * count) % tuple(values.ravel().tolist()))
        corner = f"%d{'/%d' if has_texture else '/' if has_normals else ''}{'/%d' if has_normals else ''}"
        numbers = mesh.faces.reshape(-1, 1) + self._first[np.array(used)]
        line = f"f {corner} {corner} {corner}\n"
        self._pieces.append((line * len(mesh.faces)) % tuple(numbers.ravel().tolist()))
        self._first += count * np.array(used)

    def encode(self) -> bytes:
        """Return the file's bytes."""
        return "".join(self._pieces).encode()


def write_obj(scene: ExportScene) -> Files:
    """Return `NAME.obj`, what is seen, with `NAME.mtl` and the texture, and `NAME-collision.obj`."""
    name = scene.facts.name
    head = f"# MineXplore; mine frame: x east, y north, z up, m\n{_FACTS}{json.dumps(scene.facts.to_json())}\n"
    touched = ObjText(head)
    for part in scene.parts:
        touched.add(part.name, _group(part), "", part_mesh(part))
    seen = ObjText(f"{head}mtllib {name}.mtl\n")
    for surface in scene.surfaces:
        seen.add(surface.name, _group(surface), surface.material, surface.mesh)
    used = {surface.material for surface in scene.surfaces}
    materials = "\n".join(_material(scene.materials[key]) for key in sorted(used)).encode()
    files = {f"{name}-collision.obj": touched.encode(), f"{name}.obj": seen.encode(), f"{name}.mtl": materials}
    if scene.texture is not None:
        files[ROCK_TEXTURE] = scene.texture
    return files


def _group(item: ConvexPart | Surface) -> str:
    """Return label and zone as one word without an underscore; zones have no hyphen."""
    return ".".join(filter(None, (item.label, item.zone.replace("_", "-"))))


def part_mesh(part: ConvexPart) -> TriangleMesh:
    """Return the hull of a part in the mine frame."""
    vertices, faces = hull_of(part)
    return TriangleMesh(vertices + part.centre_m, faces, np.zeros((0, 2)), _NOTHING)


def _material(material: Material) -> str:
    red, green, blue, alpha = material.rgba
    lines = [f"newmtl {material.name}", f"Kd {red:g} {green:g} {blue:g}", f"Ns {128 * material.shininess:g}"]
    lines += [f"d {alpha:g}", "illum 2", *([f"map_Kd {ROCK_TEXTURE}"] if material.textured else [])]
    return "\n".join(lines) + "\n"


def read_obj(folder: Path, facts: WorldFacts) -> ReadScene:
    """Return what the files of a folder hold, by trimesh."""
    parts: list[ConvexPart] = []
    surfaces: list[Surface] = []
    for path in sorted(folder.glob("*.obj")):
        _require_facts(path, facts)
        is_touched = path.stem.endswith("-collision")
        for name, group, vertices, faces in _read_objects(path):
            label, _, zone = group.replace("-", "_").partition(".")
            if is_touched:
                parts.append(placed_part(name, label, zone, None, vertices, _is_slab(name, zone) and _is_box(vertices)))
            else:
                mesh = TriangleMesh(vertices, faces, np.zeros((0, 2)), _NOTHING)
                surfaces.append(Surface(name, label, zone, "", mesh))
    return ReadScene(facts.to_json(), parts, surfaces, None)


def _read_objects(path: Path) -> Iterator[tuple[str, str, np.ndarray, np.ndarray]]:
    """Yield name, group, vertices (n, 3) m and faces (m, 3) of each object."""
    scene = trimesh.load_scene(
        path, process=False, split_objects=True, split_groups=True, group_material=False, skip_materials=True
    )
    for key, mesh in scene.geometry.items():
        name, _, group = key.rpartition("_")  # trimesh joins object and group; our groups have no underscore
        yield name, group, np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces)


def _require_facts(path: Path, facts: WorldFacts) -> None:
    with path.open() as stream:
        stated = [line for line in (stream.readline() for _ in range(2)) if line.startswith(_FACTS)]
    if not stated or json.loads(stated[0].removeprefix(_FACTS)) != facts.to_json():
        raise ArtifactError(f"{path.name}: the facts of the world differ from {facts.name}'s record")


def _is_slab(name: str, zone: str) -> bool:
    """Return whether a part of this name is the roof, or the floor of a zone, of a level mine: in the bundle a box."""
    return name in (ROOF_GEOM, floor_geom(zone))


def _is_box(vertices: np.ndarray) -> bool:
    """Return whether eight corners are those of a level box."""
    return len(vertices) == 8 and all(len(np.unique(vertices[:, axis].round(6))) == 2 for axis in range(3))
