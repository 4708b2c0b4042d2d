"""The tables of a world with heights: the wedges of floor and roof in place of level boxes."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from minexplore.bundle import (
    FLOOR,
    MODEL,
    RECORD,
    ROCK_CLASS,
    ROOF_GEOM,
    ROOF_WEDGES,
    SLAB_M,
    BundleError,
    GeomGroup,
    floor_geom,
    ground_material,
    is_floor,
    is_roof,
    zone_of_wedge,
)
from minexplore.floors.floor import Floor
from minexplore.floors.stretch import MOST_ROOF_M
from minexplore.schema.attributes import Attribute, Element, named, required
from minexplore.schema.model import MOST_PARTS, REACH_M, ZONE_NAME
from minexplore.schema.readers.rules import exactly, list_of, matching, number, numbers, numbers_in, points, same, whole
from minexplore.schema.readers.xml import Node

MOST_SHEETS = 1000
_STEEPEST_DEG = 45.0
_ON_FLOOR_M = 0.005
_FLOOR_WEDGE, _ROOF_WEDGE = rf"{floor_geom(ZONE_NAME)}_\d{{5}}", ROOF_WEDGES
_PLACE = Attribute(numbers(3, -REACH_M, REACH_M), "0 0 0")
_NOT_TURNED = Attribute(exactly("1 0 0 0"), "1 0 0 0")

HEIGHT_FIELDS = {
    "low_m": number(-REACH_M, REACH_M),
    "high_m": number(-REACH_M, REACH_M),
    "steepest_deg": number(0, _STEEPEST_DEG),
    "sheets": whole(1, MOST_SHEETS),
    "floor_wedges": whole(1, MOST_PARTS),
    "roof_wedges": whole(1, MOST_PARTS),
}
ROOF_FIELDS = {"roof_m": list_of(number(0, MOST_ROOF_M + 1), 2)}  # only where the roof has heights of its own


def _mesh(pattern: str) -> Element:
    attributes = {**named(pattern), "vertex": required(points(6, 4096, REACH_M))}
    return Element("mesh", attributes, name=pattern, most=MOST_PARTS)


def _solid(pattern: str, attributes: Mapping[str, Attribute]) -> Element:
    common = {
        **named(pattern),
        "pos": _PLACE,
        "quat": _NOT_TURNED,
        "type": required(exactly("mesh")),
        "mesh": required(matching(pattern, "the mesh of the geom's name")),
    }
    return Element("geom", {**common, **attributes}, name=pattern, most=MOST_PARTS)


_FLOOR_GEOM = _solid(
    _FLOOR_WEDGE,
    {
        "priority": required(exactly("1")),
        "friction": Attribute(numbers(1, 1e-6, 2), "1"),
        "material": required(matching(ground_material(ZONE_NAME), "the material of a floor zone")),
    },
)
_ROOF_GEOM = _solid(
    _ROOF_WEDGE,
    {"class": required(exactly(ROCK_CLASS)), "group": required(exactly(str(GeomGroup.ROOF.value)))},
)


def with_heights(table: Element) -> Element:
    """Return the table of `mine.xml` with wedges in place of the level boxes of floor and roof."""
    swapped = {floor_geom(ZONE_NAME): _FLOOR_GEOM, ROOF_GEOM: _ROOF_GEOM}
    children = [
        swapped.get(child.name, with_heights(child)) if child.tag == "geom" else with_heights(child)
        for child in table.children
    ]
    if table.tag == "asset":
        children += [_mesh(_FLOOR_WEDGE), _mesh(_ROOF_WEDGE)]
    return dataclasses.replace(table, children=tuple(children))


def check_wedges(
    of_mine: Mapping[tuple[str, str], Node],
    of_assets: Mapping[tuple[str, str], Node],
    record: Mapping[str, Any],
    floor: Floor,
) -> None:
    """Compare the wedges of floor and roof with their numbers, their zones, and the floor's mesh.

    Raises
    ------
    BundleError
        With the path of the first difference.
    """
    zones = {floor_geom(zone["name"]): zone for zone in record["zones"]}
    floors = [name for tag, name in of_mine if tag == "geom" and is_floor(name)]
    roofs = [name for tag, name in of_mine if tag == "geom" and is_roof(name)]
    _expect_numbers("floor_wedges", floors, [int(name.rpartition("_")[2]) for name in floors], record)
    _expect_numbers("roof_wedges", roofs, [int(name.rpartition("_")[2]) for name in roofs], record)
    shapes = {
        name
        for tag, name in of_assets
        if tag == "mesh" and (is_floor(name) or is_roof(name)) and "file" not in of_assets[tag, name].attributes
    }
    for name in sorted(shapes ^ {*floors, *roofs}):
        raise BundleError(f"{MODEL}: mesh {name!r}: want one geom of each wedge")
    for name in floors:
        geom, zone = of_mine["geom", name], zones.get(zone_of_wedge(name))
        if zone is None or geom.attributes["material"] != ground_material(zone["name"]):
            raise BundleError(f"{MODEL}: {geom.path}@material: {geom.attributes['material']!r}, want that of its zone")
        if not same(float(geom.attributes.get("friction", "1")), zone["friction"]):
            raise BundleError(
                f"{MODEL}: {geom.path}@friction: {geom.attributes.get('friction')}, {RECORD} gives {zone['friction']}"
            )
    _expect_slabs(floors, of_mine, of_assets, floor, (-SLAB_M, 0.0))
    _expect_slabs(roofs, of_mine, of_assets, floor.raised(record["height_m"]), (0.0, SLAB_M), "the roof")


def _expect_numbers(field: str, names: list[str], found: list[int], record: Mapping[str, Any]) -> None:
    if found != list(range(record["heights"][field])):
        raise BundleError(
            f"{MODEL}: {len(names)} wedges of other numbers than 0, 1, 2, ...; {RECORD}: heights.{field} = "
            f"{record['heights'][field]}"
        )


def _expect_slabs(
    names: list[str],
    of_mine: Mapping[tuple[str, str], Node],
    of_assets: Mapping[tuple[str, str], Node],
    floor: Floor,
    levels: tuple[float, float],
    surface: str = "the floor",
) -> None:
    """Check that every corner of these wedges lies on the mesh of the floor or the roof moved up to one of two levels.

    Parameters
    ----------
    surface : str
        For the message.
    """
    bodies = []
    for name in names:
        geom, mesh = of_mine["geom", name], of_assets["mesh", name]
        if geom.attributes["mesh"] != name:
            raise BundleError(f"{MODEL}: {geom.path}@mesh: {geom.attributes['mesh']!r}, want a mesh of the geom's name")
        corners = np.array(numbers_in(mesh.attributes["vertex"])).reshape(-1, 3)
        bodies.append(corners + (numbers_in(geom.attributes.get("pos", "0 0 0")) or []))
    if not bodies:
        return
    unfolded = floor.unfold_bodies(bodies, sum(levels) / 2)
    covered = np.split(
        floor.covers(np.concatenate(unfolded)[:, :2]), np.cumsum([len(corners) for corners in unfolded])[:-1]
    )
    for name, corners, is_covered in zip(names, unfolded, covered, strict=True):
        mesh = of_assets["mesh", name]
        if not is_covered.all():
            raise BundleError(f"{MODEL}: {mesh.path}@vertex: a corner beside {surface} of {FLOOR}")
        above = corners[:, 2]
        off = np.abs(above[:, None] - levels)
        if off.min(axis=1).max() > _ON_FLOOR_M or off.min(axis=0).max() > _ON_FLOOR_M:
            raise BundleError(
                f"{MODEL}: {mesh.path}@vertex: corners {above.min():g} to {above.max():g} m above {surface} "
                f"of {FLOOR}, want {levels[0]:g} and {levels[1]:g}"
            )
