"""The scene that a world is built from: floor zones, lights, surfaces and the mine's pose, in the mine frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from minexplore.bundle import floor_geom
from minexplore.looks import PLAIN
from pipeline.geometry.polyline import arc_length
from pipeline.params.realism import ZoneParams
from pipeline.store.codecs import Bundle
from pipeline.types import ConvexParts, DriftNetwork, Mesh, SolidExtent

ALONG = ("main_drift", "network")  # what lights may stand along
_OPEN_M = 1e9  # over the floor of a level mine, whose roof limits no light


@dataclass(frozen=True)
class ZoneStrip:
    """One floor zone: a strip of the floor (edges in m, mine frame) and its effect on a robot.

    `friction` is sliding friction. `command_scale` multiplies a commanded twist; `speed_noise_mps` is the standard
    deviation of the noise on the forward speed in each control step.
    """

    name: str
    friction: float
    command_scale: float
    speed_noise_mps: float
    rgba: tuple[float, float, float, float]
    west_m: float
    east_m: float
    south_m: float
    north_m: float

    @property
    def geom(self) -> str:
        """Return the name of the zone's geom."""
        return floor_geom(self.name)


@dataclass(frozen=True)
class SpotLight:
    """A spot light: place and direction (unit vector) in the mine frame, and cut-off angle in degrees."""

    place_m: tuple[float, float, float]
    direction: tuple[float, float, float]
    cutoff_deg: float


@dataclass(frozen=True)
class MineScene:
    """The complete content of a world, in the mine frame.

    `smooth` is the octagonal surface. `rough` holds the chunks of the rough surface as `NAME.msh`; if there are any,
    the smooth surface is hidden. `texture` is the picture of the rock as PNG. Without `smooth` nothing shows rock, and
    no texture is used. `fittings` holds the visible floor and the furniture as `NAME.msh`; water stands on the floor
    zones named in `puddles`, `water_m` above the flat floor.
    """

    name: str
    extent: SolidExtent
    parts: ConvexParts
    rock_friction: float
    floor_thickness_m: float
    zones: list[ZoneStrip]
    lights: list[SpotLight]
    smooth: dict[str, Mesh]
    rough: Bundle
    texture: bytes
    anchor_m: tuple[float, float]
    heading_rad: float
    T_world_mine: np.ndarray
    look: str = PLAIN
    fittings: Bundle = field(default_factory=dict)
    puddles: tuple[str, ...] = ()
    water_m: float = 0.0
    is_rough: bool = False  # robots stand on the visible floor

    @property
    def has_visible_rock(self) -> bool:
        """Return whether meshes show the rock."""
        return bool(self.smooth)


def tile_zones(zones: list[ZoneParams], box_m: tuple[float, float, float, float]) -> list[ZoneStrip]:
    """Divide a box (west, south, east, north; m, mine frame) into zones from west to east, of equal length to 0.1 m."""
    west, south, east, north = box_m
    edges = np.linspace(west, east, len(zones) + 1).round(1)
    return [
        ZoneStrip(
            **zone.model_dump(),
            west_m=float(edges[i]),
            east_m=float(edges[i + 1]),
            south_m=south,
            north_m=north,
        )
        for i, zone in enumerate(zones)
    ]


def box_of(zones: Sequence[ZoneStrip]) -> tuple[float, float, float, float]:
    """Return west, south, east and north, m, of the box round floor zones."""
    return (
        min(zone.west_m for zone in zones),
        min(zone.south_m for zone in zones),
        max(zone.east_m for zone in zones),
        max(zone.north_m for zone in zones),
    )


def level_lines(network: DriftNetwork, along: str) -> list[np.ndarray]:
    """Return what `place_lights` takes for a level mine: the main drift alone, or each drift of the network."""
    lines = [network.main_drift_m] if along == "main_drift" else [leg.stations_m for leg in network.legs]
    return [np.column_stack([line, np.zeros(len(line)), np.full(len(line), _OPEN_M)]) for line in lines]


def place_lights(
    lines_m: list[np.ndarray], spacing_m: float, height_m: float, pitch_deg: float, cutoff_deg: float, count: int | None
) -> list[SpotLight]:
    """Place spot lights at even distances along lines; each points along its line and slightly down.

    Parameters
    ----------
    lines_m : list of (n, 4), m, mine frame
        The floor's x, y and z, and how high above it a light may hang there.
    spacing_m : float
        Distance along the line in plan. The first and the last light are half the remainder away from the line's ends.
    height_m : float
        Height above the floor, where it may hang so high.
    pitch_deg : float
        Angle below the horizontal.
    cutoff_deg : float
        MuJoCo's `cutoff`: the angle between the axis and the cone's edge.
    count : int, optional
        Maximum number of lights per line; they are centred on it.
    """
    down = math.radians(pitch_deg)
    lights = []
    for line in lines_m:
        along = arc_length(line[:, :2])
        n = int(along[-1] // spacing_m) + 1
        n = n if count is None else min(n, count)
        for distance in (along[-1] - (n - 1) * spacing_m) / 2 + spacing_m * np.arange(n):
            x, y, floor_m, most_m = (float(np.interp(distance, along, line[:, k])) for k in range(4))
            ahead = [np.interp(min(distance + 2.0, along[-1]), along, line[:, k]) for k in (0, 1)]
            behind = [np.interp(max(distance - 2.0, 0.0), along, line[:, k]) for k in (0, 1)]
            heading = math.atan2(ahead[1] - behind[1], ahead[0] - behind[0])
            direction = (math.cos(heading) * math.cos(down), math.sin(heading) * math.cos(down), -math.sin(down))
            place = (round(x, 3), round(y, 3), floor_m + min(height_m, most_m))
            lights.append(SpotLight(place, direction, cutoff_deg))
    return lights


def tilt_about_centre(tilt_deg: float, world_m: tuple[float, float, float, float]) -> np.ndarray:
    """Return T_world_mine (4, 4), which moves the box's centre to the world's origin and then rotates about Y.

    A positive tilt lowers the east.
    """
    a = math.radians(tilt_deg)
    rotation = np.array([[math.cos(a), 0, math.sin(a)], [0, 1, 0], [-math.sin(a), 0, math.cos(a)]])
    west, south, east, north = world_m
    transform = np.eye(4)
    transform[:3, :3] = rotation
    transform[:3, 3] = -rotation @ np.array([(west + east) / 2, (south + north) / 2, 0.0])
    return transform
