"""The table of `world.json`: its fields, and what each may say. Units are m, rad, kg and s."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from minexplore.bundle import (
    FRAMES,
    GEOM_GROUPS,
    BundleError,
    has_rough_floor,
)
from minexplore.looks import LOOKS
from pipeline.schema.rules import Rule, list_of, matching, number, one_of_texts, same_json, whole

Table = Mapping[str, "Rule | Table | Callable[[str, Any], None]"]

REACH_M = 1e6  # of any coordinate
MOST_LIGHTS, MOST_PARTS = 10_000, 100_000
_ZONE_NAME = r"[a-z][a-z0-9_]{0,63}"
OPENED = Rule(lambda value: True, "what `minexplore` accepts")  # which has opened the bundle
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
    for at, zone in enumerate(zones):
        check_fields(f"{where}[{at}]", zone, _ZONE)


RECORD_FIELDS: dict[str, Any] = {
    "format": OPENED,
    "name": OPENED,
    "frames": same_json(FRAMES),
    "T_world_mine": OPENED,
    "tilt_deg": number(-30, 30),
    "gain_m": {
        "entrance_region": number(-REACH_M, REACH_M),
        "entrance_length": number(1e-6, REACH_M),
        "whole_frame": number(-REACH_M, REACH_M),
    },
    "height_m": OPENED,
    "world_m": OPENED,
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
    "rock_friction": OPENED,
    "lights": whole(1, MOST_LIGHTS),
    "collision_parts": whole(1, MOST_PARTS),
    "loops": whole(0, 1_000_000),
    "drifts": OPENED,
    "spawn": {
        "anchor_m": OPENED,
        "anchor_clearance_m": OPENED,
        "centre_m": OPENED,
        "radius_m": number(1e-6, REACH_M),
        "clearance_m": number(1e-6, REACH_M),
    },
    "look": one_of_texts(*LOOKS),
    "overlay": OPENED,
    "geom_groups": same_json(GEOM_GROUPS),
    "files": OPENED,
    "world_sha256": OPENED,
}


def check_record(file: str, record: Any) -> None:
    """Refuse a record with a field that is missing, unknown or out of range, or whose fields contradict one another.

    Raises
    ------
    BundleError
        Naming the field, its value and the limit.
    """
    check_fields(file, record, RECORD_FIELDS | ({"rough_floor": same_json(True)} if has_rough_floor(record) else {}))
    check_frame(file, record)
    check_gain(file, record)
    check_zones(file, record)


def check_frame(file: str, record: Mapping[str, Any]) -> None:
    """Compare `T_world_mine` with the tilt about the middle of the box."""
    west, south, east, north = record["world_m"]
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
