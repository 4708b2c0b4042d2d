"""The tables of a rough floor: height fields over the level planes, and what a record says of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from minexplore.bundle import (
    COVER_M,
    HFIELDS,
    MODEL,
    RECORD,
    ROUGH_FLOORS,
    BundleError,
    has_rough_floor,
    hfield_file,
    is_rough_floor,
    zone_of_rough_floor,
)
from minexplore.sealed.png import GREY, check_png
from minexplore.sealed.sizes import MOST_TILE_PIXELS
from pipeline.schema.attributes import Attribute, Element, constant, named, required
from pipeline.schema.readers.png import inflate_png
from pipeline.schema.readers.rules import exactly, matching, numbers, numbers_in, same
from pipeline.schema.readers.xml import Node

MOST_TILES = 100_000
_REACH_M = 1e6
_BEYOND_M = 1e-6

FIELD = Element(
    "hfield",
    {
        **named(ROUGH_FLOORS),
        "size": required(numbers(4, 1e-4, 1000)),
        "file": required(matching(rf"{HFIELDS}{ROUGH_FLOORS}\.png", hfield_file("NAME"))),
        "content_type": Attribute(exactly("image/png"), "image/png"),
    },
    name=ROUGH_FLOORS,
    least=0,
    most=MOST_TILES,
)
GEOM = Element(
    "geom",
    {
        **named(ROUGH_FLOORS),
        "pos": required(numbers(3, -_REACH_M, _REACH_M)),
        "quat": constant(1, 0, 0, 0, default="1 0 0 0"),
        "type": required(exactly("hfield")),
        "hfield": required(matching(ROUGH_FLOORS, "a height field of the rough floor")),
        "priority": required(exactly("1")),
        "friction": Attribute(numbers(1, 1e-6, 2), "1"),
        "rgba": constant(0, 0, 0, 0),
    },
    name=ROUGH_FLOORS,
    least=0,
    most=MOST_TILES,
)


def check_rough_floor(
    of_mine: Mapping[tuple[str, str], Node],
    of_assets: Mapping[tuple[str, str], Node],
    record: Mapping[str, Any],
    files: Mapping[str, bytes],
) -> None:
    """Compare the height fields with the record's zones: one geom and one file each, where floors are.

    Raises
    ------
    BundleError
        With the path of the first difference.
    """
    geoms = {name: node for (tag, name), node in of_mine.items() if tag == "geom" and is_rough_floor(name)}
    fields = {name: node for (tag, name), node in of_assets.items() if tag == "hfield"}
    there = {name for name in files if name.startswith(HFIELDS)}
    if bool(geoms) != has_rough_floor(record):
        raise BundleError(f"{MODEL}: {len(geoms)} geoms of a rough floor; {RECORD} states it with rough_floor = true")
    if geoms.keys() != fields.keys() or {hfield_file(name) for name in geoms} != there:
        odd = min((geoms.keys() ^ fields.keys()) or ({hfield_file(name) for name in geoms} ^ there))
        raise BundleError(f"{MODEL}: {odd!r}: want one geom and one file of each height field")
    for name, geom in geoms.items():
        _check_tile(name, geom, fields[name], record["zones"])
        size = check_png(hfield_file(name), files[hfield_file(name)], (GREY,), MOST_TILE_PIXELS)
        inflate_png(hfield_file(name), files[hfield_file(name)])
        if min(size) < 2:
            raise BundleError(f"{hfield_file(name)}: {size[0]} x {size[1]} px, want 2 or more either way")


def _check_tile(name: str, geom: Node, field: Node, zones: list[dict[str, Any]]) -> None:
    """Check that a tile has its own field, and lies in its zone, as high as a visible floor may be."""
    if geom.attributes["hfield"] != name or field.attributes["file"] != hfield_file(name):
        raise BundleError(f"{MODEL}: {geom.path}: want the height field and the file of its own name")
    if zone_of_rough_floor(name) >= len(zones):
        raise BundleError(f"{MODEL}: {geom.path}: {RECORD} has {len(zones)} zones")
    zone = zones[zone_of_rough_floor(name)]
    if not same(float(geom.attributes.get("friction", "1")), zone["friction"]):
        raise BundleError(f"{MODEL}: {geom.path}@friction: want {zone['friction']}, that of its zone")
    x, y, low = numbers_in(geom.attributes["pos"]) or [0.0] * 3
    half_x, half_y, top, _ = numbers_in(field.attributes["size"]) or [0.0] * 4
    box = (x - half_x, zone["west_m"]), (y - half_y, zone["south_m"])
    end = (x + half_x, zone["east_m"]), (y + half_y, zone["north_m"])
    if any(a < b - _BEYOND_M for a, b in box) or any(a > b + _BEYOND_M for a, b in end):
        raise BundleError(f"{MODEL}: {geom.path}@pos: reaches out of the zone {zone['name']!r}")
    if not 0 <= low <= low + top <= COVER_M + _BEYOND_M:
        raise BundleError(
            f"{MODEL}: {geom.path}: from {low:g} to {low + top:g} m over the level floor, want 0 to {COVER_M:g} m"
        )
