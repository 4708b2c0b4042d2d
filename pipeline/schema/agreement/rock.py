"""Whether collision parts, floor and roof of a model are those of its record."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from minexplore.bundle import (
    MODEL,
    RECORD,
    ROOF_GEOM,
    BundleError,
    floor_geom,
    ground_material,
    is_ground,
    is_rock,
    rock_geom,
)
from minexplore.looks import cover_rgba
from pipeline.schema.agreement.comparison import ModelElements, expect, expect_names, numbers_of, vertices_of
from pipeline.schema.readers.xml import Node

_BEYOND_M = 1.0  # approximate decompositions reach a little beyond the rock
_LEAST_M = 1e-4  # size of a collision part in every direction
_THINNEST_M = 0.05  # of floor and roof: a robot must not pass through them in one step
_EQUAL_M = 0.0501  # what rounding to a decimetre moves the end of a floor zone


def check_rock(at: ModelElements, record: Mapping[str, Any]) -> None:
    """Compare the collision parts with their number and with the box of the rock."""
    names = at.names("geom", rock_geom(0)[:-4])
    expect_names("geom", names, [rock_geom(i) for i in range(record["collision_parts"])], "collision_parts")
    shapes = {
        name
        for tag, name in at.of_assets
        if tag == "mesh" and is_rock(name) and at.of_assets[tag, name].attributes.get("vertex")
    }
    for name in names:
        geom = at.of_mine["geom", name]
        if geom.attributes["mesh"] != name or name not in shapes:
            raise BundleError(f"{MODEL}: {geom.path}@mesh: {geom.attributes['mesh']!r}, want a mesh of the geom's name")
    _check_parts(at, names, record)
    for name in sorted(shapes - set(names)):
        raise BundleError(f"{MODEL}: {at.of_assets['mesh', name].path}: no geom has this mesh")
    expect(at.rock_class, "friction", numbers_of(at.rock_class, "friction", "1"), [record["rock_friction"]])


def _check_parts(at: ModelElements, names: list[str], record: Mapping[str, Any]) -> None:
    """Check that each collision part, a geom and a mesh of this name, is solid and lies in the box of the rock."""
    geoms, meshes = [at.of_mine["geom", name] for name in names], [at.of_assets["mesh", name] for name in names]
    low, high = rock_box(record)
    shapes = vertices_of(meshes)
    vertices, count = np.concatenate(shapes), np.array([len(shape) for shape in shapes])
    starts = np.cumsum(count) - count
    middle = np.add.reduceat(vertices, starts) / count[:, None]
    apart = vertices - np.repeat(middle, count, axis=0)
    spread = np.linalg.eigvalsh(np.add.reduceat(apart[:, :, None] * apart[:, None, :], starts))[:, 0]
    thin = np.flatnonzero(~(spread > _LEAST_M**2))
    if len(thin):
        thick = math.sqrt(max(0.0, float(spread[thin[0]])))
        raise BundleError(f"{MODEL}: {meshes[thin[0]].path}@vertex: {thick:g} m thick, want {_LEAST_M}")
    place = np.array([numbers_of(geom, "pos") for geom in geoms])
    least, most = place + np.minimum.reduceat(vertices, starts), place + np.maximum.reduceat(vertices, starts)
    outside = np.argwhere((least < low - _BEYOND_M) | (most > high + _BEYOND_M))
    if len(outside):
        part, axis = outside[0]
        raise BundleError(
            f"{MODEL}: {geoms[part].path}@pos: from {least[part, axis]:g} to {most[part, axis]:g} m along axis "
            f"{axis}, the rock of {RECORD} ends at {low[axis]:g} and {high[axis]:g} m"
        )


def rock_box(record: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and the highest corner (3,) m of the rock in the mine frame."""
    west, south, east, north = record["world_m"]
    return np.array([west, south, 0.0]), np.array([east, north, record["height_m"]])


def check_zones(at: ModelElements, record: Mapping[str, Any]) -> None:
    """Compare the materials of the floor zones with the record, and the zones with the box that they divide."""
    zones = record["zones"]
    west, south, east, north = record["world_m"]
    grounds = [name for tag, name in at.of_assets if tag == "material" and is_ground(name)]
    expect_names("material", grounds, [ground_material(zone["name"]) for zone in zones], "zones")
    length = (east - west) / len(zones)
    for number, zone in enumerate(zones, start=1):  # zones are of equal length, to a decimetre
        if abs(zone["east_m"] - (west + number * length)) > _EQUAL_M:
            raise BundleError(
                f"{RECORD}: zones[{number - 1}].east_m = {zone['east_m']}: want {west + number * length:.1f}, "
                f"{len(zones)} zones of equal length"
            )
    edges = [west, *(zone["east_m"] for zone in zones)]
    for zone, left in zip(zones, edges, strict=False):
        if (zone["south_m"], zone["north_m"], zone["west_m"]) != (south, north, left) or left >= zone["east_m"]:
            raise BundleError(f"{RECORD}: zones: {zone['name']!r} leaves a gap, or differs from the rock's box")
        ground = at.of_assets["material", ground_material(zone["name"])]
        seen = cover_rgba(zone["rgba"]) if "texture" in ground.attributes else zone["rgba"]
        expect(ground, "rgba", numbers_of(ground, "rgba", "1 1 1 1"), seen)
    if zones[-1]["east_m"] != east:
        last = f"zones[{len(zones) - 1}].east_m = {zones[-1]['east_m']}"
        raise BundleError(f"{RECORD}: {last}: want {east}, as the rock's box")


def check_boxes(at: ModelElements, record: Mapping[str, Any]) -> None:
    """Compare the boxes of floor and roof with the record."""
    zones = record["zones"]
    west, south, east, north = record["world_m"]
    roof = at.of_mine["geom", ROOF_GEOM]
    half = numbers_of(roof, "size")[2]
    expect_names("geom", at.names("geom", floor_geom("")), [floor_geom(zone["name"]) for zone in zones], "zones")
    if half < _THINNEST_M / 2:
        raise BundleError(f"{MODEL}: {roof.path}@size: floor and roof are {2 * half:g} m thick, want {_THINNEST_M} m")
    for zone in zones:
        geom = at.of_mine["geom", floor_geom(zone["name"])]
        if geom.attributes["material"] != ground_material(zone["name"]):
            raise BundleError(f"{MODEL}: {geom.path}@material: want 'ground_{zone['name']}'")
        _expect_box(geom, (zone["west_m"], south, zone["east_m"], north), -half, half)
        expect(geom, "friction", numbers_of(geom, "friction", "1"), [zone["friction"]])
    _expect_box(roof, (west, south, east, north), record["height_m"] + half, half)


def _expect_box(geom: Node, box: tuple[float, float, float, float], middle_z: float, half_z: float) -> None:
    west, south, east, north = box
    expect(geom, "pos", numbers_of(geom, "pos"), [(west + east) / 2, (south + north) / 2, middle_z])
    expect(geom, "size", numbers_of(geom, "size"), [(east - west) / 2, (north - south) / 2, half_z])
