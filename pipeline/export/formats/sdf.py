"""SDF 1.9: a world with one static model, whose link has a collision a convex part and a visual a chunk.

Collision meshes are binary STL about the part's centre, visible chunks OBJ in the mine frame, which the model carries.
"""

from __future__ import annotations

import json
from xml.etree import ElementTree

import numpy as np
import trimesh

from minexplore.bundle import ROCK_TEXTURE
from pipeline.export.formats.obj import ObjText
from pipeline.export.frames import apply
from pipeline.export.scene import ConvexPart, ExportScene, Files, Light, Material, Surface, hull_of

# By `world.sdf` alone libsdformat reads its own description of that element: findings/sdformat-world-by-name.sh.
WORLD_FILE = "mine.sdf"
MODEL_NAME, NAMESPACE, PREFIX = "mine", "urn:minexplore", "minexplore"
_TOUCHED, _SEEN = "collision", "visual"  # folders of meshes
_GRAVITY = "0 0 -9.81"
_LAMP_RANGE_M = 40.0  # beyond it a lamp lights nothing; by eye


def write_sdf(scene: ExportScene) -> Files:
    """Return `mine.sdf` with its meshes and texture."""
    files: Files = {} if scene.texture is None else {ROCK_TEXTURE: scene.texture}
    T = np.array(scene.facts.T_world_mine)
    root = ElementTree.Element("sdf", {"version": "1.9", f"xmlns:{PREFIX}": NAMESPACE})
    world = ElementTree.SubElement(root, "world", {"name": scene.facts.name})
    _text(world, f"{PREFIX}:world", json.dumps(scene.facts.to_json()))
    _text(world, "gravity", _GRAVITY)
    look = ElementTree.SubElement(world, "scene")
    _text(look, "ambient", "0.3 0.3 0.3 1")
    _text(look, "background", "0 0 0 1")
    for light in scene.lights:
        _add_light(world, light, T)
    model = ElementTree.SubElement(world, "model", {"name": MODEL_NAME})
    _text(model, "static", "true")
    _text(model, "pose", _numbers([*T[:3, 3], *trimesh.transformations.euler_from_matrix(T, "sxyz")]))
    link = ElementTree.SubElement(model, "link", {"name": MODEL_NAME})
    for part in scene.parts:
        files |= _add_part(link, part)
    for surface in scene.surfaces:
        files |= _add_surface(link, surface, scene.materials[surface.material])
    ElementTree.indent(root, " ")
    text = ElementTree.tostring(root, encoding="unicode", xml_declaration=False)
    return {WORLD_FILE: f'<?xml version="1.0"?>\n{text}\n'.encode(), **files}


def _add_part(link: ElementTree.Element, part: ConvexPart) -> Files:
    element = ElementTree.SubElement(link, "collision", {"name": part.name})
    _add_label(element, part)
    _text(element, "pose", _numbers([*part.centre_m, 0, 0, 0]))
    geometry = ElementTree.SubElement(element, "geometry")
    files: Files = {}
    if part.is_box:
        _text(ElementTree.SubElement(geometry, "box"), "size", _numbers(2 * part.half_m))
    else:
        name = f"{_TOUCHED}/{part.name}.stl"
        vertices, faces = hull_of(part)
        files[name] = trimesh.exchange.stl.export_stl(trimesh.Trimesh(vertices, faces, process=False))
        _text(ElementTree.SubElement(geometry, "mesh"), "uri", name)
    friction = ElementTree.SubElement(ElementTree.SubElement(element, "surface"), "friction")
    ode = ElementTree.SubElement(friction, "ode")
    for name in ("mu", "mu2"):
        _text(ode, name, f"{part.friction:.9g}")
    return files


def _add_surface(link: ElementTree.Element, surface: Surface, material: Material) -> Files:
    element = ElementTree.SubElement(link, "visual", {"name": f"{_SEEN}_{surface.name}"})
    _add_label(element, surface)
    _text(element, "cast_shadows", "false")
    name = f"{_SEEN}/{surface.name}.obj"
    geometry = ElementTree.SubElement(element, "geometry")
    _text(ElementTree.SubElement(geometry, "mesh"), "uri", name)
    paint = ElementTree.SubElement(element, "material")
    for kind in ("ambient", "diffuse"):
        _text(paint, kind, _numbers(material.rgba))
    _text(paint, "specular", _numbers([*[0.2 * material.shininess] * 3, 1.0]))
    metal = ElementTree.SubElement(ElementTree.SubElement(paint, "pbr"), "metal")
    if material.textured:
        _text(metal, "albedo_map", ROCK_TEXTURE)
    _text(metal, "metalness", "0")
    _text(metal, "roughness", f"{1 - material.shininess:.6g}")
    text = ObjText()
    text.add(surface.name, surface.label, "", surface.mesh)
    return {name: text.encode()}


def _add_light(world: ElementTree.Element, light: Light, T: np.ndarray) -> None:
    element = ElementTree.SubElement(world, "light", {"name": light.name, "type": "spot"})
    _text(element, "pose", _numbers([*apply(T, light.place_m[None])[0], 0, 0, 0]))
    _text(element, "cast_shadows", "false")
    _text(element, "diffuse", _numbers([*light.rgb, 1.0]))
    _text(element, "direction", _numbers(T[:3, :3] @ light.direction))
    attenuation = ElementTree.SubElement(element, "attenuation")
    values = {"range": _LAMP_RANGE_M, "constant": 1.0, "linear": 0.0, "quadratic": 0.004}  # of MuJoCo's lamps
    for name, value in values.items():
        _text(attenuation, name, f"{value:g}")
    spot = ElementTree.SubElement(element, "spot")
    for name, share in (("inner_angle", 1.0), ("outer_angle", 2.0)):  # SDF states whole angles
        _text(spot, name, f"{np.radians(share * light.cutoff_deg):.9g}")
    _text(spot, "falloff", "1")


def _add_label(element: ElementTree.Element, item: ConvexPart | Surface) -> None:
    _text(element, f"{PREFIX}:label", item.label)
    if item.zone:
        _text(element, f"{PREFIX}:zone", item.zone)


def _text(parent: ElementTree.Element, name: str, value: str) -> None:
    ElementTree.SubElement(parent, name).text = value


def _numbers(values: object) -> str:
    return " ".join(f"{float(value):.17g}" for value in np.asarray(values).ravel())
