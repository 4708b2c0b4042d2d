"""The MJCF of a volume world: a mesh for each collision part, floor zones, lights and cameras."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from minexplore.bundle import (
    BARE_ROCK_RGBA,
    ENTRANCE_CAMERA,
    MINE_BODY,
    OVERVIEW_CAMERA,
    ROCK_CLASS,
    GeomGroup,
    floor_part,
    ground_material,
    rock_geom,
    spot_light,
)
from minexplore.floors.volume_arrays import FacetLabel, FloorSpans, Parts
from minexplore.looks import EXTENT_M, LOOKS, floor_texture
from pipeline.mjcf.scene import SpotLight, ZoneStrip
from pipeline.volume.world.surface.show import show_fittings, show_rock

_EYE_M, _EYE_SHARE = 1.2, 0.5  # of a camera over the floor, and of the free height there at most
_DIGITS = 7  # of coordinates about a part's middle, m
_GROUPS = {FacetLabel.WALL: GeomGroup.COLLISION, FacetLabel.ROOF: GeomGroup.ROOF}


@dataclass(frozen=True)
class VolumeScene:
    """What the MJCF of a volume world shows, in the mine frame: `offset_m` (3,) moves it to the world."""

    name: str
    parts: Parts
    zones: list[ZoneStrip]
    rock_friction: float
    lights: list[SpotLight]
    look: str
    anchor_m: tuple[float, float, float]
    eye_m: float  # of the camera over the anchor
    heading_rad: float
    world_m: tuple[float, float, float, float]
    offset_m: np.ndarray
    rock: list[str]  # names of the visible meshes
    water_m: float  # of puddles above the floor
    is_painted: bool  # the rock has the colours of a scan


def eye_over(cells: FloorSpans, anchor_m: Sequence[float]) -> float:
    """Return how high over an anchor, on a floor, a camera stands, m: as a person's, or lower under a low roof."""
    nearest = int(np.linalg.norm(cells.places_m - anchor_m, axis=1).argmin())
    return round(min(_EYE_M, _EYE_SHARE * float(cells.headroom_m[nearest])), 3)


def zone_numbers(parts: Parts, zones: Sequence[ZoneStrip]) -> np.ndarray:
    """Return the number (p,) of the zone that each part's middle lies in."""
    east, starts = parts.corners[:, 0], parts.first[:-1]
    middle = (np.minimum.reduceat(east, starts) + np.maximum.reduceat(east, starts)) / 2
    found: np.ndarray = np.searchsorted([zone.east_m for zone in zones[:-1]], middle)
    return found


def part_names(parts: Parts, zones: Sequence[ZoneStrip]) -> list[str]:
    """Return the name of each part's geom and mesh: floors by their zone, all in the order of the parts."""
    names, floors = [], 0
    for label, zone in zip(parts.label.tolist(), zone_numbers(parts, zones).tolist(), strict=True):
        if label == FacetLabel.FLOOR:
            names.append(floor_part(zones[zone].name, floors))
            floors += 1
        else:
            names.append(rock_geom(len(names) - floors))
    return names


def model_xml(scene: VolumeScene) -> bytes:
    """Return `mine.xml`. It is written as text: MuJoCo's specs take minutes for 100,000 meshes."""
    root = model_tree(scene, zip(part_meshes(scene), part_geoms(scene), strict=True))
    ElementTree.indent(root)
    return ElementTree.tostring(root) + b"\n"


def model_tree(scene: VolumeScene, parts: Iterable[tuple[Element, Element]]) -> Element:
    """Return the root of `mine.xml` with the meshes and geoms of some parts."""
    look = LOOKS[scene.look]
    root = ElementTree.Element("mujoco", model=scene.name)
    centre = np.array(scene.anchor_m) + scene.offset_m + np.array([0.0, 0.0, 0.5])
    ElementTree.SubElement(root, "statistic", extent=f"{EXTENT_M:g}", center=_text(centre.round(3)))
    visual = ElementTree.SubElement(root, "visual")
    ElementTree.SubElement(
        visual,
        "headlight",
        ambient=_text([look.ambient] * 3),
        diffuse=_text([look.diffuse] * 3),
        specular=_text([look.glint] * 3),
    )
    ElementTree.SubElement(visual, "map", znear="0.005", zfar="200")
    ElementTree.SubElement(visual, "global", offwidth="1920", offheight="1080")
    rock = ElementTree.SubElement(ElementTree.SubElement(root, "default"), "default", {"class": ROCK_CLASS})
    friction = _text([scene.rock_friction, 0.005, 0.0001])
    ElementTree.SubElement(rock, "geom", group=str(GeomGroup.COLLISION.value), material="rock", friction=friction)
    asset = ElementTree.SubElement(root, "asset")
    ElementTree.SubElement(asset, "material", name="rock", rgba=_text(BARE_ROCK_RGBA), specular="0", shininess="0")
    for zone in scene.zones:
        ground = {"name": ground_material(zone.name), "rgba": _text(zone.rgba), "emission": "0.25"}
        ElementTree.SubElement(asset, "material", ground, specular="0", shininess="0")
    world = ElementTree.SubElement(root, "worldbody")
    mine = ElementTree.SubElement(world, "body", name=MINE_BODY, pos=_text(scene.offset_m))
    for mesh, geom in parts:
        asset.append(mesh)
        mine.append(geom)
    for number, light in enumerate(scene.lights):
        ElementTree.SubElement(
            mine,
            "light",
            name=spot_light(number),
            type="spot",
            pos=_text(light.place_m),
            dir=_text(light.direction),
            cutoff=f"{light.cutoff_deg:g}",
            diffuse="1 0.93 0.8",
            specular="0.1 0.1 0.1",
        )
    for camera in _cameras(scene):
        mine.append(camera)
    show_rock(root, scene.rock, scene.look, scene.is_painted)
    show_fittings(root, scene.rock, scene.zones, scene.water_m, scene.is_painted)
    return root


def part_meshes(scene: VolumeScene) -> Iterator[Element]:
    """Yield the mesh of each part.

    It lies about its middle, as MuJoCo keeps vertices in 32 bits: findings/mujoco-mesh-corners-of-32-bits.sh.
    """
    parts = scene.parts
    about = (parts.corners - np.repeat(_middles(parts), np.diff(parts.first), axis=0)).round(_DIGITS)
    for number, name in enumerate(part_names(parts, scene.zones)):
        mesh = {"name": name, "vertex": _text(about[parts.first[number] : parts.first[number + 1]].ravel())}
        mesh["inertia"] = "shell"
        if scene.rock and parts.label[number] == FacetLabel.FLOOR:
            mesh["texcoord"] = _text(floor_texture(parts[number]).round(_DIGITS).ravel())
        yield Element("mesh", mesh)


def part_geoms(scene: VolumeScene) -> Iterator[Element]:
    """Yield the geom of each part."""
    parts, zones = scene.parts, zone_numbers(scene.parts, scene.zones)
    named = zip(part_names(parts, scene.zones), _middles(parts).tolist(), parts.label.tolist(), strict=True)
    for number, (name, middle, label) in enumerate(named):
        geom = {"name": name, "type": "mesh", "mesh": name, "pos": _text(middle)}
        if label == FacetLabel.FLOOR:
            zone = scene.zones[zones[number]]
            geom |= {
                "material": ground_material(zone.name),
                "priority": "1",
                "friction": _text([zone.friction, 0.005, 0.0001]),
                "group": str(GeomGroup.FLOOR.value),
            }
        else:
            geom |= {"class": ROCK_CLASS, "group": str(_GROUPS[FacetLabel(label)].value)}
        yield Element("geom", geom)


def _middles(parts: Parts) -> np.ndarray:
    """Return the places (p, 3) m that meshes lie about."""
    low, high = parts.boxes_m
    found: np.ndarray = ((low + high) / 2).round(4)
    return found


def _cameras(scene: VolumeScene) -> Iterator[Element]:
    """Return a camera that looks along the drift from where robots start, and one over the whole mine."""
    x, y, z = scene.anchor_m
    c, s = math.cos(scene.heading_rad), math.sin(scene.heading_rad)
    yield Element(
        "camera", name=ENTRANCE_CAMERA, pos=_text((x, y, z + scene.eye_m)), xyaxes=_text((s, -c, 0, 0, 0, 1)), fovy="70"
    )
    west, south, east, north = scene.world_m
    pitch, fovy = math.radians(60.0), 30.0
    reach = max((east - west) / 16 * 9, north - south) / 2 / math.tan(math.radians(fovy / 2)) * 1.05
    centre = np.array([(west + east) / 2, (south + north) / 2, z])
    place = centre + reach * np.array([0.0, -math.cos(pitch), math.sin(pitch)])
    up = (0.0, math.sin(pitch), math.cos(pitch))
    yield Element(
        "camera", name=OVERVIEW_CAMERA, pos=_text(place.round(2)), xyaxes=_text((1, 0, 0, *up)), fovy=f"{fovy:g}"
    )


def _text(values: Sequence[float] | np.ndarray) -> str:
    """Return numbers with all digits that they need, apart by blanks."""
    numbers = np.asarray(values, float).tolist()
    return ("%.12g " * len(numbers))[:-1] % tuple(numbers)
