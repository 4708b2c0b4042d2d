"""The zones of a mine's floor, as `world.json` states them: where they lie and what they do to a robot."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from minexplore.bundle import BundleError, floor_geom

_LIMITS: dict[str, tuple[Callable[[Any], bool], str]] = {  # what a field accepts, and how to say it
    "west_m": (lambda value: True, ""),
    "east_m": (lambda value: True, ""),
    "friction": (lambda value: value >= 0, ", 0 or more"),
    "command_scale": (lambda value: 0 < value <= 1, ", above 0 and at most 1"),
    "speed_noise_mps": (lambda value: 0 <= value <= 1, ", 0 or more and at most 1"),
}
_OTHERS = {"name", "rgba", "south_m", "north_m"}  # what a zone also says


@dataclass(frozen=True)
class FloorZone:
    """One floor zone: a strip of the floor from west to east (m, mine frame), the same on all floors over each other.

    `friction` is sliding friction, whatever the wheel's is. `command_scale` multiplies a commanded twist.
    `speed_noise_mps` is the standard deviation of the noise on the forward speed, drawn each control step.
    """

    name: str
    west_m: float
    east_m: float
    friction: float
    command_scale: float
    speed_noise_mps: float

    @property
    def geom(self) -> str:
        """Return the name of the zone's geom."""
        return floor_geom(self.name)

    def without_effects(self) -> FloorZone:
        """Return the zone as dry, firm ground: friction 1, full commands, no noise."""
        return dataclasses.replace(self, friction=1.0, command_scale=1.0, speed_noise_mps=0.0)


def read_zones(file: Path, zones: Any) -> list[FloorZone]:
    """Read the zones of a world's record, west to east.

    Raises
    ------
    BundleError
        Naming the file, the zone, and the field that is missing, unknown, or beyond its limit.
    """
    if not isinstance(zones, list) or not zones or not all(isinstance(zone, dict) for zone in zones):
        raise BundleError(f"{file}: zones = {zones!r}: want a list of one zone or more")
    found = [_read_zone(file, number, zone) for number, zone in enumerate(zones)]
    names = [zone.name for zone in found]
    for number, (before, after) in enumerate(itertools.pairwise(found), start=1):
        if after.name in names[:number]:
            raise BundleError(f"{file}: zones[{number}].name = {after.name!r}: want zones of different names")
        if before.east_m != after.west_m:
            raise BundleError(
                f"{file}: zones[{number}].west_m = {after.west_m}: want {before.east_m}, the end of the last"
            )
    return found


def _read_zone(file: Path, number: int, zone: dict[str, Any]) -> FloorZone:
    where = f"{file}: zones[{number}]"
    if not isinstance(zone.get("name"), str):
        raise BundleError(f"{where}.name = {zone.get('name')!r}: want a text")
    unknown = sorted(set(zone) - set(_LIMITS) - _OTHERS)
    if unknown:
        known = ", ".join([*_LIMITS, *sorted(_OTHERS)])
        raise BundleError(f"{where}.{unknown[0]} = {zone[unknown[0]]!r}: unknown; a zone has {known}")
    for field, (accepts, limit) in _LIMITS.items():
        value = zone.get(field)
        is_number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        if not is_number or not accepts(value):
            raise BundleError(f"{where}.{field} = {value!r}: want a finite number{limit}")
    if zone["west_m"] >= zone["east_m"]:
        raise BundleError(f"{where}.east_m = {zone['east_m']!r}: want more than west_m, {zone['west_m']!r}")
    return FloorZone(zone["name"], **{field: zone[field] for field in _LIMITS})
