"""Whether what a model shows is what its record states: pose, look, cameras, lights and visible meshes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from minexplore.bundle import (
    ENTRANCE_CAMERA,
    MODEL,
    OVERVIEW_CAMERA,
    RECORD,
    SMOOTH_MESHES,
    BundleError,
    GeomGroup,
    is_fitting,
    mesh_file,
    spot_light,
    surface_geom,
)
from minexplore.looks import CUT_MATERIAL, EXTENT_M, PLAIN, look_of
from pipeline.schema.agreement.comparison import ModelElements, expect, expect_names, numbers_of

_ROUND_M = 1e-4  # the camera's place has four decimals
_CENTRE_M = 6e-4  # the view's centre has three decimals
_TURN = 1e-4


def check_look(at: ModelElements, record: Mapping[str, Any]) -> None:
    """Compare light, haze and the rock's sheen with those of the look that the record states."""
    look, plain = look_of(record), record["look"] == PLAIN
    for name, value in (("ambient", look.ambient), ("diffuse", look.diffuse), ("specular", look.glint)):
        expect(at.visual["headlight"], name, numbers_of(at.visual["headlight"], name), [value] * 3)
    for name, default, distance in (("fogstart", "3", look.haze_m[0]), ("fogend", "10", look.haze_m[1])):
        expect(at.visual["map"], name, numbers_of(at.visual["map"], name, default), [distance / EXTENT_M])
    rock = at.of_assets["material", "rock"]
    expect(rock, "specular", numbers_of(rock, "specular"), [look.specular])
    expect(rock, "shininess", numbers_of(rock, "shininess"), [look.shininess])
    if ("rgba" in at.visual) != look.hazy:
        raise BundleError(f"{MODEL}: visual/rgba: want the colour of the haze, if {RECORD}: look has any")
    if look.hazy:
        expect(at.visual["rgba"], "fog", numbers_of(at.visual["rgba"], "fog"), [*look.haze_rgb, 1.0])
    cut = ("material", CUT_MATERIAL) in at.of_assets
    wanted = "rock" if plain else CUT_MATERIAL
    if cut == plain or at.rock_class.attributes["material"] != wanted:
        raise BundleError(f"{MODEL}: {at.rock_class.path}@material: want {wanted!r}, as {RECORD}: look gives")


def check_pose(at: ModelElements, record: Mapping[str, Any]) -> None:
    """Compare the mine's pose and the view's centre with the transform, the tilt and the spawn's anchor."""
    T, half = record["T_world_mine"], math.radians(record["tilt_deg"]) / 2
    expect(at.mine, "pos", numbers_of(at.mine, "pos"), [row[3] for row in T[:3]])
    expect(at.mine, "quat", numbers_of(at.mine, "quat", "1 0 0 0"), [math.cos(half), 0.0, math.sin(half), 0.0])
    anchor = [*record["spawn"]["anchor_m"], 0.5, 1.0]
    centre = [sum(c * a for c, a in zip(row, anchor, strict=True)) for row in T[:3]]
    expect(at.statistic, "center", numbers_of(at.statistic, "center"), centre, _CENTRE_M)


def check_cameras(at: ModelElements, record: Mapping[str, Any]) -> None:
    """Compare the cameras with the spawn's anchor, a level view, and the box of the rock."""
    entrance, overview = at.of_mine["camera", ENTRANCE_CAMERA], at.of_mine["camera", OVERVIEW_CAMERA]
    expect(entrance, "pos", numbers_of(entrance, "pos"), [*record["spawn"]["anchor_m"], 1.2], _ROUND_M)
    w, x, y, z = numbers_of(entrance, "quat", "1 0 0 0")
    # A level view along any heading: its up axis is the mine's z, its right axis is level.
    if abs(2 * (y * z + w * x) - 1) > _TURN or abs(2 * (x * z - w * y)) > _TURN:
        raise BundleError(f"{MODEL}: {entrance.path}@quat: {entrance.attributes.get('quat')!r}, want a level view")
    west, south, east, north = record["world_m"]
    pitch, fovy = math.radians(60.0), 30.0
    reach = max((east - west) / 16 * 9, north - south) / 2 / math.tan(math.radians(fovy / 2)) * 1.05
    middle = [(west + east) / 2, (south + north) / 2 - reach * math.cos(pitch), reach * math.sin(pitch)]
    expect(overview, "pos", numbers_of(overview, "pos"), middle, 6e-3)  # two decimals
    turn = math.radians(30.0) / 2
    expect(overview, "quat", numbers_of(overview, "quat", "1 0 0 0"), [math.cos(turn), math.sin(turn), 0.0, 0.0], 1e-6)


def check_lights(at: ModelElements, record: Mapping[str, Any]) -> None:
    """Compare the spot lights with their number, and require one height, pitch and cutoff of all."""
    names = at.names("light", "")
    expect_names("light", names, [spot_light(i) for i in range(record["lights"])], "lights")
    west, south, east, north = record["world_m"]
    kinds = set()
    for name in names:
        light = at.of_mine["light", name]
        x, y, z = numbers_of(light, "pos")
        if not (west <= x <= east and south <= y <= north and 0 < z <= 1000):
            raise BundleError(f"{MODEL}: {light.path}@pos: {x:g} {y:g} {z:g}, want a place above the floor in world_m")
        pitch = numbers_of(light, "dir", "0 0 -1")[2]
        kinds.add((round(z, 4), round(pitch, 4), light.attributes.get("cutoff", "45")))
        if pitch > _TURN or len(kinds) > 1:
            raise BundleError(f"{MODEL}: {light.path}: height, pitch or cutoff differ from those of {names[0]}")


def check_surface(at: ModelElements, files: set[str]) -> None:
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
