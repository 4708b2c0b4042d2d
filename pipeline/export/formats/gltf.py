"""glTF 2.0 as binary `.glb`: one file of what is seen, one of what is touched.

The nodes are placed in MuJoCo's world frame, turned to glTF's, whose y is up. Written by hand: no library here writes
lights, extras of nodes and equal bytes at every run.
"""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

from minexplore import __version__
from pipeline.export.frames import Z_UP_TO_Y_UP, turn_quaternion
from pipeline.export.scene import (
    ConvexPart,
    ExportScene,
    Files,
    Light,
    Material,
    Surface,
    box_corners,
    hull_of,
    placed_part,
)

MINE_NODE = "mine"
_FLOAT, _UINT = 5126, 5125  # glTF's names of component types, and of what a buffer's view is for
_VERTICES, _INDICES = 34962, 34963
_LIGHTS = "KHR_lights_punctual"
_CANDELA = 60.0  # of a lamp; by eye: MuJoCo's lights have no unit
_REPEAT, _LINEAR, _MIPMAPS = 10497, 9729, 9987
_PLAIN = Material("rock", (0.54, 0.44, 0.36, 1.0), False, 0.0)


def write_gltf(scene: ExportScene) -> Files:
    """Return `NAME.glb`, what is seen, and `NAME-collision.glb`."""
    touched, seen = f"{scene.facts.name}-collision.glb", f"{scene.facts.name}.glb"
    return {
        touched: _Writer(scene).add_parts().encode(),
        seen: _Writer(scene).add_surfaces().add_lights().encode(),
    }


class _Writer:
    """One file in the making: its JSON, and the bytes of its buffer."""

    def __init__(self, scene: ExportScene) -> None:
        self._scene = scene
        self._buffer: list[bytes] = []
        self._size = 0
        self._materials: dict[str, int] = {}
        self._children: list[int] = []
        facts = scene.facts
        turned = Z_UP_TO_Y_UP @ np.array(facts.T_world_mine)
        mine = {"name": MINE_NODE, "matrix": turned.T.ravel().tolist(), "children": self._children}
        self._json: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": f"MineXplore {__version__}", "copyright": facts.licence},
            "scene": 0,
            "scenes": [{"name": facts.name, "nodes": [0], "extras": facts.to_json()}],
            "nodes": [mine],
            "meshes": [],
            "accessors": [],
            "bufferViews": [],
        }

    def add_surfaces(self) -> _Writer:
        """Add what is seen: a node a chunk, materials and texture."""
        for surface in self._scene.surfaces:
            self._node({"name": surface.name, "mesh": self._surface_mesh(surface), "extras": _extras(surface)})
        return self

    def add_lights(self) -> _Writer:
        """Add the lamps; a spot light shines along -z of its node."""
        if self._scene.lights:
            self._json["extensionsUsed"] = [_LIGHTS]
            self._json["extensions"] = {_LIGHTS: {"lights": [_light(light) for light in self._scene.lights]}}
        for number, light in enumerate(self._scene.lights):
            x, y, z, w = np.roll(turn_quaternion(np.array([0.0, 0.0, -1.0]), light.direction), -1).tolist()
            node = {"name": light.name, "translation": light.place_m.tolist(), "rotation": [x, y, z, w]}
            self._node({**node, "extensions": {_LIGHTS: {"light": number}}})
        return self

    def add_parts(self) -> _Writer:
        """Add what is touched: a node a convex part; boxes are one cube, scaled, so that no digit is lost."""
        cube = placed_part("box", "", "", None, box_corners(np.ones(3)))
        numbers: dict[str, int] = {}
        for part in self._scene.parts:
            shape = cube if part.is_box else part
            if shape.name not in numbers:
                numbers[shape.name] = self._mesh(shape.name, *hull_of(shape), {}, self._material(_PLAIN))
            node = {"name": part.name, "mesh": numbers[shape.name], "translation": part.centre_m.tolist()}
            if part.is_box:
                node["scale"] = part.half_m.tolist()
            self._node({**node, "extras": {**_extras(part), "collides": True, "friction": part.friction}})
        return self

    def encode(self) -> bytes:
        """Return the file's bytes."""
        body = b"".join(self._buffer)
        self._json["buffers"] = [{"byteLength": len(body)}]
        text = json.dumps(self._json, allow_nan=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(body), 0x004E4942) + body
        return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks

    def _node(self, node: dict[str, Any]) -> None:
        self._children.append(len(self._json["nodes"]))
        self._json["nodes"].append(node)

    def _surface_mesh(self, surface: Surface) -> int:
        mesh, attributes = surface.mesh, {}
        if len(mesh.normals) == len(mesh.vertices):
            attributes["NORMAL"] = self._accessor(mesh.normals, "VEC3")
        if len(mesh.texcoords) == len(mesh.vertices):
            attributes["TEXCOORD_0"] = self._accessor(mesh.texcoords, "VEC2")
        material = self._material(self._scene.materials[surface.material])
        return self._mesh(surface.name, mesh.vertices, mesh.faces, attributes, material)

    def _mesh(
        self, name: str, vertices: np.ndarray, faces: np.ndarray, attributes: dict[str, int], material: int
    ) -> int:
        primitive = {
            "attributes": {"POSITION": self._accessor(vertices, "VEC3", bounded=True), **attributes},
            "indices": self._accessor(faces, "SCALAR"),
            "material": material,
        }
        self._json["meshes"].append({"name": name, "primitives": [primitive]})
        return len(self._json["meshes"]) - 1

    def _accessor(self, values: np.ndarray, kind: str, bounded: bool = False) -> int:
        is_index = kind == "SCALAR"
        array = values.astype("<u4" if is_index else "<f4")
        accessor: dict[str, Any] = {
            "bufferView": self._view(array.tobytes(), _INDICES if is_index else _VERTICES),
            "componentType": _UINT if is_index else _FLOAT,
            "count": array.size if is_index else len(array),
            "type": kind,
        }
        if bounded:
            accessor |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        self._json["accessors"].append(accessor)
        return len(self._json["accessors"]) - 1

    def _view(self, data: bytes, target: int | None = None) -> int:
        view = {"buffer": 0, "byteOffset": self._size, "byteLength": len(data)}
        self._json["bufferViews"].append(view | ({"target": target} if target else {}))
        padded = data + b"\0" * (-len(data) % 4)
        self._buffer.append(padded)
        self._size += len(padded)
        return len(self._json["bufferViews"]) - 1

    def _material(self, material: Material) -> int:
        if material.name not in self._materials:
            self._materials[material.name] = len(self._materials)
            self._json.setdefault("materials", []).append(self._described(material))
        return self._materials[material.name]

    def _described(self, material: Material) -> dict[str, Any]:
        surface: dict[str, Any] = {
            "baseColorFactor": list(material.rgba),
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0 - material.shininess,
        }
        if material.textured and self._scene.texture is not None:
            if "textures" not in self._json:
                image = {"name": "rock", "mimeType": "image/png", "bufferView": self._view(self._scene.texture)}
                sampler = {"magFilter": _LINEAR, "minFilter": _MIPMAPS, "wrapS": _REPEAT, "wrapT": _REPEAT}
                self._json |= {"images": [image], "samplers": [sampler], "textures": [{"source": 0, "sampler": 0}]}
            surface["baseColorTexture"] = {"index": 0}
        return {"name": material.name, "pbrMetallicRoughness": surface}


def _extras(item: ConvexPart | Surface) -> dict[str, Any]:
    return {"label": item.label} | ({"zone": item.zone} if item.zone else {})


def _light(light: Light) -> dict[str, Any]:
    outer = float(np.radians(min(light.cutoff_deg, 90.0)))
    cone = {"innerConeAngle": 0.0, "outerConeAngle": outer}
    return {"name": light.name, "type": "spot", "color": list(light.rgb), "intensity": _CANDELA, "spot": cone}
