"""What `world.json` says of a world that is one volume."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.mjcf.scene import ZoneStrip
from pipeline.types import Areas, Frame
from pipeline.volume.world.topology import Start


@dataclass(frozen=True)
class OpenEnd:
    """A station where the survey ends and the volume is closed, m, mine frame."""

    station: str
    place_m: tuple[float, float, float]


@dataclass(frozen=True)
class BuiltVolume:
    """What was built of a survey: lengths in m, all of the file, of the piece that was chosen, and in the free space.

    `datum_m` is the elevation of the mine frame's z = 0. `pieces` are those that share no station with this one, each
    with its length and a station of it. `refused_parts` are slivers that MuJoCo does not compile. `is_drawn` says that
    it is the space over drawn areas.
    """

    surveyed_m: float
    piece_m: float
    built_m: float
    datum_m: float
    entrances: list[OpenEnd]
    closed_ends: list[OpenEnd]
    pieces: list[tuple[str, float]]
    refused_parts: int
    is_drawn: bool


@dataclass(frozen=True)
class VolumeFigures:
    """Sizes of the volume: facets, vertices, parts and floor parts, storeys, and heights in m; see `BuiltVolume`."""

    facets: int
    vertices: int
    parts: int
    floors: int
    storeys: int
    low_m: float
    high_m: float
    surveyed_m: float
    piece_m: float
    built_m: float
    datum_m: float
    entrances: list[OpenEnd]
    closed_ends: list[OpenEnd]
    is_drawn: bool


@dataclass(frozen=True)
class VolumeRecord:
    """The content of `world.json` of a volume world; units are m and rad, except where a name states another."""

    format: str
    name: str
    frames: dict[str, str]
    T_world_mine: list[list[float]]
    tilt_deg: float
    gain_m: dict[str, float]
    world_m: tuple[float, float, float, float]
    plan_frame: Frame
    areas: Areas
    zones: list[ZoneStrip]
    rock_friction: float
    lights: int
    collision_parts: int
    loops: int
    drifts: int
    spawn: Start
    look: str
    overlay: str
    geom_groups: dict[str, int]
    files: dict[str, str]
    world_sha256: str
    volume: VolumeFigures
