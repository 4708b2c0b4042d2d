"""Fittings as MJCF: the visible floor, its puddles and the furniture, in a body of their own that never collides."""

from __future__ import annotations

from pathlib import Path

import mujoco

from minexplore.bundle import (
    FITTINGS_BODY,
    SURFACE_CLASS,
    WATER_MATERIAL,
    cover_material,
    fitting_geom,
    fitting_material,
    is_cover,
    mesh_file,
    puddle_geom,
    trodden_material,
)
from minexplore.looks import FURNITURE_LOOKS, TEXTURE_PER_M, WATER, cover_rgba
from pipeline.mjcf.scene import MineScene
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
    for zone in scene.zones if any(map(is_cover, names)) else []:
        body.add_geom(
            shown,
            name=puddle_geom(zone.name),
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            pos=[(zone.west_m + zone.east_m) / 2, (zone.south_m + zone.north_m) / 2, scene.water_m],
            size=[(zone.east_m - zone.west_m) / 2, (zone.north_m - zone.south_m) / 2, 1.0],
            material=WATER_MATERIAL if zone.name in scene.puddles else trodden_material(zone.name),
        )
    return {mesh_file(Path(file).stem): data for file, data in scene.fittings.items()}


def _add_materials(spec: mujoco.MjSpec, scene: MineScene, used: set[str]) -> None:
    for zone in scene.zones:
        for name, trodden in ((cover_material(zone.name), False), (trodden_material(zone.name), True)):
            if cover_material(zone.name) in used and not (trodden and zone.name in scene.puddles):
                material = spec.add_material(
                    name=name, rgba=cover_rgba(zone.rgba, trodden), specular=0.0, shininess=0.0
                )
                material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "rock"
                if trodden:  # a plane has no texture coordinates of its own
                    material.texuniform, material.texrepeat = True, [TEXTURE_PER_M, TEXTURE_PER_M]
    for kind, (rgba, specular) in FURNITURE_LOOKS.items():
        if fitting_material(kind, []) in used:
            spec.add_material(name=fitting_material(kind, []), rgba=rgba, specular=specular, shininess=0.4)
    if scene.puddles:
        rgba, reflectance = WATER
        spec.add_material(name=WATER_MATERIAL, rgba=rgba, specular=0.5, shininess=0.9, reflectance=reflectance)
