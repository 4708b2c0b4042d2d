"""The table of `world.json`: its fields, and what each may say. Units are m, rad, kg and s."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from minexplore.bundle import (
    FORMAT,
    FRAMES,
    GEOM_GROUPS,
    NO_OVERLAY,
    ROUGH_OVERLAY,
    VOLUME_FORMAT,
    BundleError,
    has_rough_floor,
)
from minexplore.looks import LOOKS
from minexplore.sealed.sizes import MOST_ZONES
from pipeline.schema.rules import Rule, list_of, matching, number, one_of_texts, same_json, whole

Table = Mapping[str, "Rule | Table | Callable[[str, Any], None]"]

REACH_M = 1e6  # of any coordinate
MOST_LIGHTS, MOST_PARTS = 10_000, 100_000
_WORLD_NAME = r"[A-Za-z0-9_-]{1,64}"
_ZONE_NAME = r"[a-z][a-z0-9_]{0,63}"
_HASH = matching("[0-9a-f]{64}", "a sha256 in hexadecimal digits")
_PLACE = list_of(number(-REACH_M, REACH_M), 2)
LENGTH = number(0, REACH_M)
_AREA = number(0, REACH_M**2)
_ROUND = 5.1e-4  # lengths of the record have three decimals
_TINY = 1e-9
_DECIMETRE_M = 0.0501  # what rounding to a decimetre moves the end of a floor zone

_ZONE: Table = {
    "name": matching(_ZONE_NAME, f"a name like {_ZONE_NAME}"),
    "friction": number(1e-6, 2),
    "command_scale": number(1e-6, 1),
    "speed_noise_mps": number(0, 1),
    "rgba": list_of(number(0, 1), 4),
    "west_m": number(-REACH_M, REACH_M),
    "east_m": number(-REACH_M, REACH_M),
    "south_m": number(-REACH_M, REACH_M),
    "north_m": number(-REACH_M, REACH_M),
}


def _check_zones(where: str, zones: Any) -> None:
    if not isinstance(zones, list) or not 1 <= len(zones) <= MOST_ZONES:
        raise BundleError(f"{where} = {shown(zones)}: want a list of 1 to {MOST_ZONES} zones")
    for at, zone in enumerate(zones):
        check_fields(f"{where}[{at}]", zone, _ZONE)


def _check_files(where: str, files: Any) -> None:
    if not isinstance(files, dict):
        raise BundleError(f"{where} = {shown(files)}: want file names and their sha256")
    for name, digest in files.items():
        if not _HASH.accepts(digest):
            raise BundleError(f"{where}[{name[:80]!r}] = {shown(digest)}: want {_HASH.wants}")


RECORD_FIELDS: dict[str, Any] = {
    "format": same_json(FORMAT),
    "name": matching(_WORLD_NAME, "1 to 64 letters, digits, _ and -"),
    "frames": same_json(FRAMES),
    "T_world_mine": list_of(list_of(number(-2 * REACH_M, 2 * REACH_M), 4), 4),
    "tilt_deg": number(-30, 30),
    "gain_m": {
        "entrance_region": number(-REACH_M, REACH_M),
        "entrance_length": number(1e-6, REACH_M),
        "whole_frame": number(-REACH_M, REACH_M),
    },
    "height_m": number(0.5, 50),
    "world_m": list_of(number(-REACH_M, REACH_M), 4),
    "plan_frame": {
        "px_per_m": number(1e-6, 1e6),
        "origin_col": number(-1e12, 1e12),
        "origin_row": number(-1e12, 1e12),
        "width_px": whole(1, 1_000_000),
        "height_px": whole(1, 1_000_000),
    },
    "areas": {
        "tunnel_m2": _AREA,
        "islands_m2": _AREA,
        "outside_m2": _AREA,
        "islands": whole(0, 1_000_000),
        "traced_tunnel_m2": _AREA,
        "unconnected_m2": _AREA,
    },
    "zones": _check_zones,
    "rock_friction": number(1e-6, 2),
    "lights": whole(1, MOST_LIGHTS),
    "collision_parts": whole(1, MOST_PARTS),
    "loops": whole(0, 1_000_000),
    "drifts": whole(1, 1_000_000),
    "spawn": {
        "anchor_m": _PLACE,
        "anchor_clearance_m": LENGTH,
        "centre_m": _PLACE,
        "radius_m": number(1e-6, REACH_M),
        "clearance_m": number(1e-6, REACH_M),
    },
    "look": one_of_texts(*LOOKS),
    "overlay": one_of_texts(ROUGH_OVERLAY, NO_OVERLAY),
    "geom_groups": same_json(GEOM_GROUPS),
    "files": _check_files,
    "world_sha256": _HASH,
}


def check_record(file: str, record: Any) -> None:
    """Refuse a record with a field that is missing, unknown or out of range, or whose fields contradict one another.

    Raises
    ------
    BundleError
        Naming the field, its value and the limit.
    """
    if not isinstance(record, dict):
        raise BundleError(f"{file}: not a world bundle's record (a JSON object)")
    if record.get("format") != FORMAT:
        raise BundleError(
            f"{file}: format {shown(record.get('format'))}, this version reads {FORMAT!r} and {VOLUME_FORMAT!r}"
        )
    check_fields(file, record, RECORD_FIELDS | ({"rough_floor": same_json(True)} if has_rough_floor(record) else {}))
    check_frame(file, record)
    west, south, east, north = record["world_m"]
    check_gain(file, record)
    check_zones(file, record)
    for name in ("anchor_m", "centre_m"):
        x, y = record["spawn"][name]
        if name == "anchor_m" and not (west < x < east and south < y < north):
            raise BundleError(f"{file}: spawn.{name} = [{x}, {y}]: want a place in world_m = {record['world_m']}")


def check_frame(file: str, record: Mapping[str, Any]) -> None:
    """Refuse a box without an area, and compare `T_world_mine` with the tilt about its middle."""
    west, south, east, north = record["world_m"]
    if not (west < east and south < north):
        raise BundleError(f"{file}: world_m = {record['world_m']}: want west < east and south < north")
    a = math.radians(record["tilt_deg"])
    rotation = [[math.cos(a), 0.0, math.sin(a)], [0.0, 1.0, 0.0], [-math.sin(a), 0.0, math.cos(a)]]
    middle = ((west + east) / 2, (south + north) / 2, 0.0)
    wanted = [[*row, -sum(c * m for c, m in zip(row, middle, strict=True))] for row in rotation]
    wanted.append([0.0, 0.0, 0.0, 1.0])
    for i, row in enumerate(record["T_world_mine"]):
        for j, value in enumerate(row):
            if abs(value - wanted[i][j]) > _TINY * max(1.0, abs(wanted[i][j])):
                raise BundleError(
                    f"{file}: T_world_mine[{i}][{j}] = {value!r}: want {wanted[i][j]!r}, "
                    f"the tilt of {record['tilt_deg']} deg about the middle of world_m"
                )


def check_zones(file: str, record: Mapping[str, Any]) -> None:
    """Refuse zones that are not of equal length, to a decimetre, or do not divide the rock's box from west to east."""
    zones = record["zones"]
    west, south, east, north = record["world_m"]
    length, left = (east - west) / len(zones), west
    for at, zone in enumerate(zones):
        where, end = f"{file}: zones[{at}]", west + (at + 1) * length
        if abs(zone["east_m"] - end) > _DECIMETRE_M:
            raise BundleError(f"{where}.east_m = {zone['east_m']}: want {end:.1f}, {len(zones)} zones of equal length")
        if (zone["south_m"], zone["north_m"], zone["west_m"]) != (south, north, left) or left >= zone["east_m"]:
            raise BundleError(f"{where}: {zone['name']!r} leaves a gap, or differs from the rock's box")
        left = zone["east_m"]
    if left != east:
        raise BundleError(f"{file}: zones[{len(zones) - 1}].east_m = {left}: want {east}, as the rock's box")


def check_gain(file: str, record: Mapping[str, Any], rise_m: float | None = None) -> None:
    """Compare the heights that robots gain with the tilt, or with the rise of a volume."""
    gain, slope = record["gain_m"], math.sin(math.radians(record["tilt_deg"]))
    west, _, east, _ = record["world_m"]
    whole = slope * (east - west) if rise_m is None else rise_m
    for name, rise in (("entrance_region", slope * gain["entrance_length"]), ("whole_frame", whole)):
        if abs(gain[name] - rise) > _ROUND:
            raise BundleError(f"{file}: gain_m.{name} = {gain[name]}: want {rise:.3f}")


def check_fields(where: str, values: Any, table: Table) -> None:
    """Refuse fields that a table does not have, that are missing, or whose values its rules do not accept."""
    if not isinstance(values, dict):
        raise BundleError(f"{where} = {shown(values)}: want an object with {', '.join(table)}")
    path = f"{where}." if "]" in where or ": " in where else f"{where}: "
    for name in values:
        if name not in table:
            raise BundleError(f"{path}{name[:60]} = {shown(values[name])}: unknown; known are {', '.join(table)}")
    for name, rule in table.items():
        if name not in values:
            raise BundleError(f"{path}{name}: missing")
        if isinstance(rule, Rule):
            if not rule.accepts(values[name]):
                raise BundleError(f"{path}{name} = {shown(values[name])}: want {rule.wants}")
        elif isinstance(rule, Mapping):
            check_fields(f"{path}{name}", values[name], rule)
        else:
            rule(f"{path}{name}", values[name])


def shown(value: Any) -> str:
    """Return a value for a message, of 100 characters at most."""
    text = repr(value)
    return text if len(text) <= 100 else text[:100] + "..."
