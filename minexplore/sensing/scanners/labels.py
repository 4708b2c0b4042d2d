"""What a ray or a pixel hits: one number a kind of surface."""

from __future__ import annotations

from collections.abc import Mapping

from minexplore.bundle import (
    FURNITURE,
    fitting_geom,
    is_cover,
    is_rock,
    surface_geom,
)
from minexplore.floors.floor_zones import FloorZone

# No world has fences and shafts any more; their numbers stay, so that those of robots and dust do.
LABELS = ("nothing", "rock", "roof", "floor", "wet floor", "water", *FURNITURE, "fence", "shaft", "robot", "dust")
NUMBERS: Mapping[str, int] = {name: number for number, name in enumerate(LABELS)}
NOTHING, ROCK, ROOF, FLOOR, WET_FLOOR, WATER, DUST = (
    NUMBERS[name] for name in ("nothing", "rock", "roof", "floor", "wet floor", "water", "dust")
)
WATER_SCALE = 0.5  # a zone that slows a robot to less than this lies under water; the default's water by 0.4, mud 0.7


def label_of_zone(zone: FloorZone) -> int:
    """Return the label of a zone's floor, by how much it slows a robot: dry, wet, or under water."""
    if zone.command_scale >= 1:
        return FLOOR
    return WET_FLOOR if zone.command_scale >= WATER_SCALE else WATER


def label_of_mesh(name: str) -> int:
    """Return the label of a visible mesh or of a caster's mesh by its name; floors count as dry until placed."""
    name = name.removeprefix(fitting_geom("")).removeprefix(surface_geom(""))
    kind = name.partition("_")[0].partition(" ")[0]
    if kind in NUMBERS and kind != "nothing":
        return NUMBERS[kind]
    if is_cover(name):
        return FLOOR
    return ROCK if is_rock(name) or name else NOTHING
