"""What shows the visible rock of a volume: its elements in `mine.xml`, its meshes and its texture."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from typing import Any

from minexplore.bundle import (
    FURNITURE_MESH,
    MESHES,
    MINE_BODY,
    MODEL,
    NO_OVERLAY,
    RECORD,
    ROCK_CLASS,
    ROCK_TEXTURE,
    ROUGH_MESH,
    SURFACE_BODY,
    SURFACE_CLASS,
    VISIBLE_MESH,
    BundleError,
    ground_material,
    has_visible_rock,
    is_fitting,
    mesh_file,
    surface_geom,
)
from minexplore.floors.volume_arrays import VolumeArrays
from minexplore.looks import CUT_MATERIAL
from minexplore.sealed.png import PALETTE, RGB, check_png
from minexplore.sealed.sizes import MOST_PIXELS
from minexplore.sealed.volume import MOST_OF_PART
from pipeline.schema.agreement.comparison import ModelElements
from pipeline.schema.agreement.views import check_look
from pipeline.schema.attributes import Element, constant, named, required
from pipeline.schema.fittings import BODY, MATERIALS, MESH, check_fittings
from pipeline.schema.meshes import check_meshes
from pipeline.schema.model import REACH_M, WORLD, ZONE_NAME
from pipeline.schema.readers.png import inflate_png
from pipeline.schema.readers.rules import exactly, matching, points
from pipeline.schema.readers.xml import Node
from pipeline.schema.volume.model import FLOOR_NAMES, VOLUME_WORLD

_BEYOND_M = 1.0  # that visible rock reaches beyond the free space, at most
_MESH_FILE = re.compile(rf"{MESHES}(?:{ROUGH_MESH}|{FURNITURE_MESH})\.msh", re.ASCII)


def _child(element: Element, tag: str, name: str = "") -> Element:
    return next(child for child in element.children if (child.tag, child.name) == (tag, name))


def _with(element: Element, *children: Element) -> Element:
    """Return an element with other children, which replace those of their tag and name."""
    other = {(child.tag, child.name) for child in children}
    kept = [child for child in element.children if (child.tag, child.name) not in other]
    return dataclasses.replace(element, children=(*kept, *children))


def _more(element: Element, attributes: Mapping[str, Any]) -> Element:
    """Return an element with other attributes, which replace those of their name."""
    return dataclasses.replace(element, attributes={**element.attributes, **attributes})


def _rough(element: Element, attributes: Mapping[str, Any]) -> Element:
    """Return an element of visible meshes with the names of a rough surface alone."""
    name = element.name.replace(VISIBLE_MESH, ROUGH_MESH)
    return dataclasses.replace(_more(element, attributes), name=name, least=1)


def _with_rock() -> Element:
    """Return the table of `mine.xml` of a volume with that which shows rock in other worlds."""
    assets, default = _child(WORLD, "asset"), _child(WORLD, "default")
    rock_class = _child(_child(VOLUME_WORLD, "default"), "default", ROCK_CLASS)
    of_parts = {**rock_class.children[0].attributes, "material": required(exactly("rock", CUT_MATERIAL))}
    rock_class = _with(rock_class, Element("geom", of_parts))
    mesh = _rough(
        _child(assets, "mesh", VISIBLE_MESH),
        {**named(ROUGH_MESH), "file": required(matching(rf"{MESHES}{ROUGH_MESH}\.msh", mesh_file("NAME")))},
    )
    seen = [_child(assets, "texture", "rock"), _child(assets, "material", "rock")]
    seen += [_child(assets, "material", CUT_MATERIAL), mesh, *MATERIALS, MESH]
    floor = _child(_child(VOLUME_WORLD, "asset"), "mesh", FLOOR_NAMES)
    seen += [_more(floor, {"texcoord": required(points(4, MOST_OF_PART, REACH_M, 2))})]
    ground = _child(_child(VOLUME_WORLD, "asset"), "material", ground_material(ZONE_NAME))
    seen += [_more(ground, {"texture": required(exactly("rock")), "emission": constant(0)})]
    own = _child(_child(VOLUME_WORLD, "worldbody"), "body", MINE_BODY)
    surface = _child(_child(_child(WORLD, "worldbody"), "body", MINE_BODY), "body", SURFACE_BODY)
    geom = _rough(
        surface.children[0],
        {**named(surface_geom(ROUGH_MESH)), "mesh": required(matching(ROUGH_MESH, "a visible mesh"))},
    )
    light = next(child for child in own.children if child.tag == "light")
    as_seen = {"castshadow": required(exactly("false")), "attenuation": constant(1, 0, 0.004), "exponent": constant(8)}
    light = _more(light, as_seen)
    return _with(
        VOLUME_WORLD,
        _child(WORLD, "visual"),
        _with(_child(VOLUME_WORLD, "default"), rock_class, _child(default, "default", SURFACE_CLASS)),
        _with(_child(VOLUME_WORLD, "asset"), *seen),
        _with(
            _child(VOLUME_WORLD, "worldbody"), _with(own, light, dataclasses.replace(surface, children=(geom,)), BODY)
        ),
    )


ROCK_VOLUME_WORLD = _with_rock()


def require_rock_files(record: Mapping[str, Any], files: Mapping[str, bytes]) -> set[str]:
    """Return the names of the files that show rock; refuse them in a world without, and a world that lacks them.

    Raises
    ------
    BundleError
        Naming the file.
    """
    found = {name for name in files if name == ROCK_TEXTURE or _MESH_FILE.fullmatch(name)}
    if not has_visible_rock(record):
        for name in sorted(found):
            raise BundleError(
                f"{name}: no file of a world that is one volume, as {RECORD} says overlay = {NO_OVERLAY!r}"
            )
    elif ROCK_TEXTURE not in found or len(found) < 2:
        raise BundleError(f"{MESHES if ROCK_TEXTURE in found else ROCK_TEXTURE}: missing")
    return found


def check_rock(root: Node, record: Mapping[str, Any], files: Mapping[str, bytes], volume: VolumeArrays) -> None:
    """Refuse meshes and a texture that no volume has, and a model that shows others.

    Raises
    ------
    BundleError
        Naming the file or the element, the value and the limit.
    """
    vertices = volume.facets.vertices
    check_meshes(files, vertices.min(axis=0) - _BEYOND_M, vertices.max(axis=0) + _BEYOND_M, volume.spans.heights_over)
    width, height = check_png(ROCK_TEXTURE, files[ROCK_TEXTURE], (RGB, PALETTE), MOST_PIXELS[ROCK_TEXTURE])
    inflate_png(ROCK_TEXTURE, files[ROCK_TEXTURE])
    if width != height or width < 16:
        raise BundleError(f"{ROCK_TEXTURE}: {width} x {height} px, want a square of 16 px or more")
    at = ModelElements(root)
    check_look(at, record)
    shown = {node.name: node.attributes["file"] for node in at.assets if "file" in node.attributes and node.name}
    shown.pop("rock", None)
    for name, file in shown.items():
        if file != mesh_file(name) or file not in files:
            raise BundleError(f"{MODEL}: asset/mesh[{name}]@file: {file!r}, want {mesh_file(name)!r} of the bundle")
    for file in sorted(name for name in files if name.startswith(MESHES)):
        if file not in shown.values():
            raise BundleError(f"{file}: {MODEL} does not use it")
    geoms = {geom.name: geom.attributes["mesh"] for geom in at.surface}
    if geoms != {surface_geom(name): name for name in shown if not is_fitting(name)}:
        raise BundleError(f"{MODEL}: worldbody/body[mine]/body[surface]: want one geom of each visible mesh")
    for geom in at.surface:
        if "group" in geom.attributes:
            raise BundleError(f"{MODEL}: {geom.path}@group: want that of its class")
    check_fittings(at.fittings, at.of_assets, record)
