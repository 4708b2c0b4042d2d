"""Whether `mine.xml` of a volume says the same as its arrays and `world.json`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from minexplore.bundle import (
    ENTRANCE_CAMERA,
    MODEL,
    PARTS,
    RECORD,
    BundleError,
    GeomGroup,
    floor_part,
    ground_material,
    rock_geom,
    spot_light,
)
from minexplore.floors.volume_arrays import FacetLabel, Parts, VolumeArrays
from minexplore.looks import floor_texture, look_of
from pipeline.schema.agreement.comparison import ModelElements, expect, expect_names, numbers_of, vertices_of
from pipeline.schema.agreement.rock import check_zones
from pipeline.schema.readers.xml import Node

_EQUAL_M = 1e-6  # of a part's corners: the model has seven decimals
_ROUND_M = 6e-4  # places with three decimals
_GROUPS = {FacetLabel.WALL: GeomGroup.COLLISION, FacetLabel.ROOF: GeomGroup.ROOF}
_ROLLING = (0.005, 0.0001)  # MuJoCo's own, beside the sliding friction
_EYE_M = 1.2  # of the entrance's camera, over the floor


def check_volume_model(root: Node, record: Mapping[str, Any], volume: VolumeArrays) -> None:
    """Refuse a model that differs from its record or its parts.

    Raises
    ------
    BundleError
        With the path of the first difference.
    """
    at = ModelElements(root)
    if root.attributes["model"] != record["name"]:
        raise BundleError(f"{MODEL}: mujoco@model: {root.attributes['model']!r}, {RECORD} says {record['name']!r}")
    _check_views(at, record)
    check_zones(at, record)
    _check_parts(at, record, volume.parts)


def _check_views(at: ModelElements, record: Mapping[str, Any]) -> None:
    """Compare pose, light and cameras with the record."""
    look, offset = look_of(record), np.array(record["T_world_mine"])[:3, 3]
    for name, value in (("ambient", look.ambient), ("diffuse", look.diffuse), ("specular", look.glint)):
        expect(at.visual["headlight"], name, numbers_of(at.visual["headlight"], name), [value] * 3)
    anchor = np.array(record["spawn"]["anchor_m"])
    expect(at.mine, "pos", numbers_of(at.mine, "pos"), offset)
    expect(
        at.statistic, "center", numbers_of(at.statistic, "center"), anchor + offset + np.array([0, 0, 0.5]), _ROUND_M
    )
    camera = at.of_mine["camera", ENTRANCE_CAMERA]
    expect(camera, "pos", numbers_of(camera, "pos"), anchor + np.array([0, 0, _EYE_M]), _ROUND_M)
    expect_names("light", at.names("light", ""), [spot_light(k) for k in range(record["lights"])], "lights")
    figures, (west, south, east, north) = record["volume"], record["world_m"]
    low, high = np.array([west, south, figures["low_m"]]), np.array([east, north, figures["high_m"]])
    for light in (node for node in at.mine.children if node.tag == "light"):
        place = np.array(numbers_of(light, "pos"))
        if not ((place >= low) & (place <= high)).all():
            raise BundleError(f"{MODEL}: {light.path}@pos: {place.tolist()}, want a place in the volume's box")


def _check_parts(at: ModelElements, record: Mapping[str, Any], parts: Parts) -> None:
    """Compare names, shapes, groups and frictions of the parts with the arrays and the zones."""
    low, high = parts.boxes_m
    zones = record["zones"]
    zone = np.searchsorted([one["east_m"] for one in zones[:-1]], (low[:, 0] + high[:, 0]) / 2)
    wanted = _names_of(parts, [zones[k]["name"] for k in zone.tolist()])
    expect_names("geom", at.names("geom", ""), wanted, PARTS)
    solid = [node.name for node in at.assets if node.tag == "mesh" and "file" not in node.attributes]
    expect_names("mesh", solid, wanted, PARTS)
    geoms = [at.of_mine["geom", name] for name in wanted]
    meshes = [at.of_assets["mesh", name] for name in wanted]
    _check_shapes(geoms, meshes, parts)
    _check_texture(meshes, parts)
    rock = [record["rock_friction"], *_ROLLING]
    expect(at.rock_class, "friction", numbers_of(at.rock_class, "friction"), rock)
    for geom, label, k in zip(geoms, parts.label.tolist(), zone.tolist(), strict=True):
        if label == FacetLabel.FLOOR:
            expect(geom, "friction", numbers_of(geom, "friction"), [zones[k]["friction"], *_ROLLING])
            _expect_text(geom, "material", ground_material(zones[k]["name"]))
        else:
            _expect_text(geom, "group", str(_GROUPS[FacetLabel(label)].value))


def _names_of(parts: Parts, zones: list[str]) -> list[str]:
    """Return the parts' names: floors by their zone, all in the order of the arrays."""
    names, floors = list[str](), 0
    for label, zone in zip(parts.label.tolist(), zones, strict=True):
        is_floor = label == FacetLabel.FLOOR
        names.append(floor_part(zone, floors) if is_floor else rock_geom(len(names) - floors))
        floors += is_floor
    return names


def _check_shapes(geoms: list[Node], meshes: list[Node], parts: Parts) -> None:
    """Compare the meshes' vertices, at their geoms' places, with the parts' corners."""
    for geom in geoms:
        _expect_text(geom, "mesh", geom.name)
    shapes = vertices_of(meshes)
    count = np.array([len(shape) for shape in shapes])
    odd = np.flatnonzero(count != np.diff(parts.first))
    if len(odd):
        k = odd[0]
        raise BundleError(f"{MODEL}: {meshes[k].path}@vertex: {count[k]} points, {PARTS} has {np.diff(parts.first)[k]}")
    place = np.array([numbers_of(geom, "pos") for geom in geoms])
    off = np.abs(np.concatenate(shapes) + np.repeat(place, count, axis=0) - parts.corners).max(axis=1)
    if off.max() > _EQUAL_M:
        k = int(np.searchsorted(parts.first, off.argmax(), side="right")) - 1
        raise BundleError(f"{MODEL}: {meshes[k].path}@vertex: {off.max():g} m beside its part of {PARTS}")


def _check_texture(meshes: list[Node], parts: Parts) -> None:
    """Compare the texture of floors, which only worlds with visible rock have, with the corners of their parts."""
    for number, mesh in enumerate(meshes):
        if "texcoord" in mesh.attributes:
            wanted = floor_texture(parts[number]).ravel()
            found = np.array(numbers_of(mesh, "texcoord"))
            if found.shape != wanted.shape or np.abs(found - wanted).max() > _EQUAL_M:
                raise BundleError(f"{MODEL}: {mesh.path}@texcoord: want those of its part's corners in {PARTS}")


def _expect_text(node: Node, attribute: str, wanted: str) -> None:
    if node.attributes[attribute] != wanted:
        raise BundleError(f"{MODEL}: {node.path}@{attribute}: {node.attributes[attribute]!r}, want {wanted!r}")
