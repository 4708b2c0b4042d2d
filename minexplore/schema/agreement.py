"""Whether `mine.xml`, `world.json` and the files of a bundle say the same."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from itertools import zip_longest
from typing import Any

import numpy as np

from minexplore.bundle import (
    ENTRANCE_CAMERA,
    FITTINGS_BODY,
    MINE_BODY,
    MODEL,
    OVERVIEW_CAMERA,
    RECORD,
    ROCK_CLASS,
    ROOF_GEOM,
    SURFACE_BODY,
    BundleError,
    GeomGroup,
    floor_geom,
    ground_material,
    has_visible_rock,
    is_fitting,
    is_ground,
    is_rock,
    mesh_file,
    rock_geom,
    spot_light,
    surface_geom,
)
from minexplore.floors.floor import Floor
from minexplore.floors.floor_zones import zoned_box
from minexplore.looks import CUT_MATERIAL, EXTENT_M, PLAIN, look_of
from minexplore.schema.fittings import check_fittings
from minexplore.schema.heights import check_wedges
from minexplore.schema.model import SMOOTH_MESHES
from minexplore.schema.readers.rules import numbers_in, same
from minexplore.schema.readers.xml import Node

_BEYOND_M = 1.0  # approximate decompositions reach a little beyond the rock
_LEAST_M = 1e-4  # size of a collision part in every direction
_THINNEST_M = 0.05  # of floor and roof: a robot must not pass through them in one step
_EQUAL_M = 0.0501  # what rounding to a decimetre moves the end of a floor zone
_ROUND_M = 1e-4  # places above a floor with heights have four decimals
_CENTRE_M = 6e-4  # the view's centre has three decimals
_TURN = 1e-4


def check_agreement(root: Node, record: Mapping[str, Any], meshes: Iterable[str], floor: Floor) -> None:
    """Refuse a model that differs from its record, or names other meshes than the bundle has.

    Parameters
    ----------
    root : Node
        `mine.xml`, which the table of elements allows.
    record : dict
        `world.json`, which the table of fields allows.
    meshes : iterable of str
        The files below `meshes/`.
    floor : Floor
        Of `floor.npz`; without triangles in a flat world.

    Raises
    ------
    BundleError
        With the path of the first difference.
    """
    at = _Elements(root)
    if root.attributes["model"] != record["name"]:
        raise BundleError(f"{MODEL}: mujoco@model: {root.attributes['model']!r}, {RECORD} says {record['name']!r}")
    _check_look(at, record)
    _check_pose(at, record, floor)
    _check_rock(at, record, floor)
    _check_zones(at, record, floor)
    if floor.is_flat:
        _check_boxes(at, record)
    else:
        check_wedges(at.of_mine, at.of_assets, record, floor)
    _check_cameras(at, record, floor)
    _check_lights(at, record, floor)
    if has_visible_rock(record):
        _check_surface(at, set(meshes))
    check_fittings(at.fittings, at.of_assets, record)


class _Elements:
    """The elements of a model by tag and name."""

    def __init__(self, root: Node) -> None:
        sections = {node.tag: node for node in root.children}
        self.statistic, self.assets = sections["statistic"], sections["asset"].children
        (self.mine,) = (node for node in sections["worldbody"].children if node.name == MINE_BODY)
        surfaces = [node for node in self.mine.children if node.name == SURFACE_BODY]  # at most one
        self.surface = [geom for surface in surfaces for geom in surface.children]
        self.fittings = next((node for node in self.mine.children if node.name == FITTINGS_BODY), None)
        (self.rock_class,) = (
            node.children[0] for node in sections["default"].children if node.attributes["class"] == ROCK_CLASS
        )
        self.of_mine = {(node.tag, node.name): node for node in self.mine.children}
        self.visual = {node.tag: node for node in sections["visual"].children}
        self.of_assets = {(node.tag, node.name): node for node in self.assets}

    def names(self, tag: str, prefix: str) -> list[str]:
        return [name for kind, name in self.of_mine if kind == tag and name.startswith(prefix)]


def _numbers(node: Node, attribute: str, default: str = "0 0 0") -> list[float]:
    return numbers_in(node.attributes.get(attribute, default)) or []  # the table of elements has accepted it


def _expect(node: Node, attribute: str, found: Iterable[float], wanted: Iterable[float], margin: float = 0.0) -> None:
    found, wanted = list(found), list(wanted)
    if not all(same(one, two) or abs(one - two) <= margin for one, two in zip(found, wanted, strict=True)):
        raise BundleError(
            f"{MODEL}: {node.path}@{attribute}: {' '.join(f'{v:g}' for v in found)}, {RECORD} gives "
            f"{' '.join(f'{v:.9g}' for v in wanted)}"
        )


def _check_look(at: _Elements, record: Mapping[str, Any]) -> None:
    """Compare light, haze and the rock's sheen with those of the look that the record states."""
    look, plain = look_of(record), record["look"] == PLAIN
    for name, value in (("ambient", look.ambient), ("diffuse", look.diffuse), ("specular", look.glint)):
        _expect(at.visual["headlight"], name, _numbers(at.visual["headlight"], name), [value] * 3)
    for name, default, distance in (("fogstart", "3", look.haze_m[0]), ("fogend", "10", look.haze_m[1])):
        _expect(at.visual["map"], name, _numbers(at.visual["map"], name, default), [distance / EXTENT_M])
    rock = at.of_assets["material", "rock"]
    _expect(rock, "specular", _numbers(rock, "specular"), [look.specular])
    _expect(rock, "shininess", _numbers(rock, "shininess"), [look.shininess])
    if ("rgba" in at.visual) != look.hazy:
        raise BundleError(f"{MODEL}: visual/rgba: want the colour of the haze, if {RECORD}: look has any")
    if look.hazy:
        _expect(at.visual["rgba"], "fog", _numbers(at.visual["rgba"], "fog"), [*look.haze_rgb, 1.0])
    cut = ("material", CUT_MATERIAL) in at.of_assets
    wanted = "rock" if plain else CUT_MATERIAL
    if cut == plain or at.rock_class.attributes["material"] != wanted:
        raise BundleError(f"{MODEL}: {at.rock_class.path}@material: want {wanted!r}, as {RECORD}: look gives")


def _check_pose(at: _Elements, record: Mapping[str, Any], floor: Floor) -> None:
    T, half = record["T_world_mine"], math.radians(record["tilt_deg"]) / 2
    _expect(at.mine, "pos", _numbers(at.mine, "pos"), [row[3] for row in T[:3]])
    _expect(at.mine, "quat", _numbers(at.mine, "quat", "1 0 0 0"), [math.cos(half), 0.0, math.sin(half), 0.0])
    anchor = [*_folded(floor, [*record["spawn"]["anchor_m"], 0.5]), 1.0]
    centre = [sum(c * a for c, a in zip(row, anchor, strict=True)) for row in T[:3]]
    _expect(at.statistic, "center", _numbers(at.statistic, "center"), centre, _CENTRE_M)


def _folded(floor: Floor, place_m: list[float]) -> list[float]:
    """Return a place (x, y, z above the floor) m of the plan in the mine frame."""
    return place_m if floor.is_flat else floor.fold(np.array([place_m]))[0].tolist()  # type: ignore[no-any-return]


def _check_rock(at: _Elements, record: Mapping[str, Any], floor: Floor) -> None:
    """Compare the collision parts with their number and with the box of the rock."""
    names = at.names("geom", rock_geom(0)[:-4])
    _consecutive("geom", names, [rock_geom(i) for i in range(record["collision_parts"])], "collision_parts")
    shapes = {
        name
        for tag, name in at.of_assets
        if tag == "mesh" and is_rock(name) and at.of_assets[tag, name].attributes.get("vertex")
    }
    for name in names:
        geom = at.of_mine["geom", name]
        if geom.attributes["mesh"] != name or name not in shapes:
            raise BundleError(f"{MODEL}: {geom.path}@mesh: {geom.attributes['mesh']!r}, want a mesh of the geom's name")
    _check_parts(at, names, record, floor)
    for name in sorted(shapes - set(names)):
        raise BundleError(f"{MODEL}: {at.of_assets['mesh', name].path}: no geom has this mesh")
    _expect(at.rock_class, "friction", _numbers(at.rock_class, "friction", "1"), [record["rock_friction"]])


def _check_parts(at: _Elements, names: list[str], record: Mapping[str, Any], floor: Floor) -> None:
    """Check that each collision part, a geom and a mesh of this name, is solid and lies in the box of the rock."""
    geoms, meshes = [at.of_mine["geom", name] for name in names], [at.of_assets["mesh", name] for name in names]
    low, high = rock_box(record, floor)
    lists = [_numbers(mesh, "vertex") for mesh in meshes]
    vertices = np.array(list(itertools.chain.from_iterable(lists))).reshape(-1, 3)
    count = np.array([len(numbers) // 3 for numbers in lists])
    starts = np.cumsum(count) - count
    middle = np.add.reduceat(vertices, starts) / count[:, None]
    apart = vertices - np.repeat(middle, count, axis=0)
    spread = np.linalg.eigvalsh(np.add.reduceat(apart[:, :, None] * apart[:, None, :], starts))[:, 0]
    thin = np.flatnonzero(~(spread > _LEAST_M**2))
    if len(thin):
        thick = math.sqrt(max(0.0, float(spread[thin[0]])))
        raise BundleError(f"{MODEL}: {meshes[thin[0]].path}@vertex: {thick:g} m thick, want {_LEAST_M}")
    place = np.array([_numbers(geom, "pos") for geom in geoms])
    least, most = place + np.minimum.reduceat(vertices, starts), place + np.maximum.reduceat(vertices, starts)
    outside = np.argwhere((least < low - _BEYOND_M) | (most > high + _BEYOND_M))
    if len(outside):
        part, axis = outside[0]
        raise BundleError(
            f"{MODEL}: {geoms[part].path}@pos: from {least[part, axis]:g} to {most[part, axis]:g} m along axis "
            f"{axis}, the rock of {RECORD} ends at {low[axis]:g} and {high[axis]:g} m"
        )


def rock_box(record: Mapping[str, Any], floor: Floor) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and the highest corner (3,) m of the rock in the mine frame."""
    west, south, east, north = record["world_m"]
    low, high = np.array([west, south, 0.0]), np.array([east, north, record["height_m"]])
    if not floor.is_flat:
        low[:2] -= floor.offset_m.max(axis=0)
        high[:2] -= floor.offset_m.min(axis=0)
        lowest = min((opening["bottom_m"] for opening in record.get("openings", [])), default=np.inf)
        low[2] = min(lowest, record["heights"]["low_m"])
        roof = record["heights"]["high_m"] + max((record["height_m"], *record["heights"].get("roof_m", ())))
        high[2] = max([roof, *(o["top_m"] for o in record.get("openings", []) if o["sheet"] is None)])
        for opening in (opening for opening in record.get("openings", []) if "bends_m" in opening):
            aside = np.array(opening["bends_m"])[:, :2]
            low[:2] += np.minimum(aside.min(axis=0), 0.0)
            high[:2] += np.maximum(aside.max(axis=0), 0.0)
    return low, high


def _check_zones(at: _Elements, record: Mapping[str, Any], floor: Floor) -> None:
    """Compare the materials of the floor zones with the record, and the zones with the box that they divide."""
    zones = record["zones"]
    west, south, east, north = zoned_box(record["world_m"], floor)
    grounds = [name for tag, name in at.of_assets if tag == "material" and is_ground(name)]
    _consecutive("material", grounds, [ground_material(zone["name"]) for zone in zones], "zones")
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
        _expect(ground, "rgba", _numbers(ground, "rgba", "1 1 1 1"), zone["rgba"])
    if zones[-1]["east_m"] != east:
        last = f"zones[{len(zones) - 1}].east_m = {zones[-1]['east_m']}"
        raise BundleError(f"{RECORD}: {last}: want {east}, as the rock's box")


def _check_boxes(at: _Elements, record: Mapping[str, Any]) -> None:
    """Compare the boxes of floor and roof with the record."""
    zones = record["zones"]
    west, south, east, north = record["world_m"]
    roof = at.of_mine["geom", ROOF_GEOM]
    half = _numbers(roof, "size")[2]
    _consecutive("geom", at.names("geom", floor_geom("")), [floor_geom(zone["name"]) for zone in zones], "zones")
    if half < _THINNEST_M / 2:
        raise BundleError(f"{MODEL}: {roof.path}@size: floor and roof are {2 * half:g} m thick, want {_THINNEST_M} m")
    for zone in zones:
        geom = at.of_mine["geom", floor_geom(zone["name"])]
        if geom.attributes["material"] != ground_material(zone["name"]):
            raise BundleError(f"{MODEL}: {geom.path}@material: want 'ground_{zone['name']}'")
        _expect_box(geom, (zone["west_m"], south, zone["east_m"], north), -half, half)
        _expect(geom, "friction", _numbers(geom, "friction", "1"), [zone["friction"]])
    _expect_box(roof, (west, south, east, north), record["height_m"] + half, half)


def _expect_box(geom: Node, box: tuple[float, float, float, float], middle_z: float, half_z: float) -> None:
    west, south, east, north = box
    _expect(geom, "pos", _numbers(geom, "pos"), [(west + east) / 2, (south + north) / 2, middle_z])
    _expect(geom, "size", _numbers(geom, "size"), [(east - west) / 2, (north - south) / 2, half_z])


def _check_cameras(at: _Elements, record: Mapping[str, Any], floor: Floor) -> None:
    """Compare the cameras with the spawn's anchor, a level view, and the box of the rock."""
    entrance, overview = at.of_mine["camera", ENTRANCE_CAMERA], at.of_mine["camera", OVERVIEW_CAMERA]
    _expect(entrance, "pos", _numbers(entrance, "pos"), _folded(floor, [*record["spawn"]["anchor_m"], 1.2]), _ROUND_M)
    w, x, y, z = _numbers(entrance, "quat", "1 0 0 0")
    # A level view along any heading: its up axis is the mine's z, its right axis is level.
    if abs(2 * (y * z + w * x) - 1) > _TURN or abs(2 * (x * z - w * y)) > _TURN:
        raise BundleError(f"{MODEL}: {entrance.path}@quat: {entrance.attributes.get('quat')!r}, want a level view")
    west, south, east, north = record["world_m"]
    pitch, fovy = math.radians(60.0), 30.0
    reach = max((east - west) / 16 * 9, north - south) / 2 / math.tan(math.radians(fovy / 2)) * 1.05
    middle = [(west + east) / 2, (south + north) / 2 - reach * math.cos(pitch), reach * math.sin(pitch)]
    _expect(overview, "pos", _numbers(overview, "pos"), middle, 6e-3)  # two decimals
    turn = math.radians(30.0) / 2
    _expect(overview, "quat", _numbers(overview, "quat", "1 0 0 0"), [math.cos(turn), math.sin(turn), 0.0, 0.0], 1e-6)


def _check_lights(at: _Elements, record: Mapping[str, Any], floor: Floor) -> None:
    names = at.names("light", "")
    _consecutive("light", names, [spot_light(i) for i in range(record["lights"])], "lights")
    west, south, east, north = record["world_m"]
    kinds = set()
    for name in names:
        light = at.of_mine["light", name]
        x, y, z = _numbers(light, "pos")
        if not floor.is_flat:
            x, y, z = floor.unfold(np.array([[x, y, z]]))[0].round(3).tolist()
        if not (west <= x <= east and south <= y <= north and 0 < z <= 1000):
            raise BundleError(f"{MODEL}: {light.path}@pos: {x:g} {y:g} {z:g}, want a place above the floor in world_m")
        pitch = _numbers(light, "dir", "0 0 -1")[2]
        kinds.add((round(z, 4), round(pitch, 4), light.attributes.get("cutoff", "45")))
        if pitch > _TURN or len(kinds) > 1:  # heights are those above the floor
            raise BundleError(f"{MODEL}: {light.path}: height, pitch or cutoff differ from those of {names[0]}")


def _check_surface(at: _Elements, files: set[str]) -> None:
    """Compare the visible meshes with their files, and the groups of their geoms with what they show."""
    meshes = [node for node in at.assets if node.tag == "mesh" and "file" in node.attributes]
    for mesh in meshes:
        if mesh.attributes["file"] != mesh_file(mesh.name):
            raise BundleError(f"{MODEL}: {mesh.path}@file: {mesh.attributes['file']!r}, want {mesh_file(mesh.name)!r}")
        if mesh.attributes["file"] not in files:
            raise BundleError(f"{MODEL}: {mesh.path}@file: {mesh.attributes['file']!r} is not in the bundle")
    names = {mesh.name for mesh in meshes}
    for file in sorted(files - {mesh_file(name) for name in names}):
        raise BundleError(f"{file}: {MODEL} does not use it")
    names = {name for name in names if not is_fitting(name)}
    missing = sorted(set(SMOOTH_MESHES) - names)
    if missing:
        raise BundleError(f"{MODEL}: asset: no mesh {missing[0]!r}")
    shown = {geom.attributes["mesh"] for geom in at.surface}
    if shown != names or len(at.surface) != len(names):
        odd = sorted(shown ^ names)[:1] or sorted(shown)[:1]
        raise BundleError(f"{MODEL}: worldbody/body[mine]/body[surface]: want one geom of each mesh; see {odd[0]!r}")
    rough = len(names) > len(SMOOTH_MESHES)
    for geom in at.surface:
        name = geom.attributes["mesh"]
        if geom.name != surface_geom(name):
            raise BundleError(f"{MODEL}: {geom.path}@mesh: {name!r} is not the mesh of this name")
        hidden = rough and name in SMOOTH_MESHES
        group = GeomGroup.SMOOTH_SURFACE if hidden else GeomGroup.ROUGH_SURFACE
        if geom.attributes.get("group", str(GeomGroup.ROUGH_SURFACE.value)) != str(group.value):
            raise BundleError(f"{MODEL}: {geom.path}@group: want {group.value}")


def _consecutive(tag: str, names: list[str], wanted: list[str], field: str) -> None:
    if names != wanted:
        pairs = zip_longest(names, wanted, fillvalue="none")
        number, (found, want) = next((k, pair) for k, pair in enumerate(pairs, 1) if pair[0] != pair[1])
        raise BundleError(f"{MODEL}: <{tag}> {number}: {found!r}, want {want!r} ({RECORD}: {field})")
