"""Fittings as MJCF: the visible floor, its puddles and the furniture, in a body of their own that never collides."""

from __future__ import annotations

from pathlib import Path

import mujoco

from minexplore.bundle import (
    FITTINGS_BODY,
    SHADE_MATERIAL,
    SURFACE_CLASS,
    WATER_MATERIAL,
    cover_material,
    fitting_geom,
    fitting_material,
    is_cover,
    mesh_file,
    puddle_geom,
    shade_geom,
)
from minexplore.looks import FURNITURE_LOOKS, SHADE, SHADE_LEVELS, WATER, cover_rgba
from pipeline.mjcf.scene import MineScene, ZoneStrip, box_of
from pipeline.store.codecs import Bundle


def add_fittings(spec: mujoco.MjSpec, mine: mujoco.MjsBody, scene: MineScene) -> Bundle:
    """Add a scene's fittings, if it has any, and return their mesh files."""
    if not scene.fittings:
        return {}
    body = mine.add_body(name=FITTINGS_BODY)
    shown = spec.find_default(SURFACE_CLASS)
    zones = [zone.name for zone in scene.zones]
    names = [Path(file).stem for file in scene.fittings]
    _add_materials(spec, scene, {fitting_material(name, zones) for name in names})
    for name in names:
        spec.add_mesh(name=name, file=mesh_file(name), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        body.add_geom(shown, name=fitting_geom(name), meshname=name, material=fitting_material(name, zones))
    if any(map(is_cover, names)):
        _add_planes(body, shown, scene)
    return {mesh_file(Path(file).stem): data for file, data in scene.fittings.items()}


def _add_planes(body: mujoco.MjsBody, shown: mujoco.MjsDefault, scene: MineScene) -> None:
    """Add water on the flooded zones, and a stack of clear planes that darkens hollows with soft borders."""

    def add(name: str, zones: list[ZoneStrip], level_m: float, material: str) -> None:
        west, south, east, north = box_of(zones)
        body.add_geom(
            shown,
            name=name,
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            pos=[(west + east) / 2, (south + north) / 2, level_m],
            size=[(east - west) / 2, (north - south) / 2, 1.0],
            material=material,
        )

    for zone in scene.zones:
        if zone.name in scene.puddles:
            add(puddle_geom(zone.name), [zone], scene.water_m, WATER_MATERIAL)
    for layer, share in enumerate(SHADE_LEVELS):
        add(shade_geom(layer), scene.zones, share * scene.water_m, SHADE_MATERIAL)


def _add_materials(spec: mujoco.MjSpec, scene: MineScene, used: set[str]) -> None:
    for zone in scene.zones:
        if cover_material(zone.name) in used:
            material = spec.add_material(
                name=cover_material(zone.name), rgba=cover_rgba(zone.rgba), specular=0.0, shininess=0.0
            )
            material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "rock"
    if any(name.startswith(cover_material("")) for name in used):
        spec.add_material(name=SHADE_MATERIAL, rgba=SHADE, specular=0.0, shininess=0.0)
    for kind, (rgba, specular) in FURNITURE_LOOKS.items():
        if fitting_material(kind, []) in used:
            spec.add_material(name=fitting_material(kind, []), rgba=rgba, specular=specular, shininess=0.4)
    if scene.puddles:
        rgba, reflectance = WATER
        spec.add_material(name=WATER_MATERIAL, rgba=rgba, specular=0.5, shininess=0.9, reflectance=reflectance)
