"""Read a sealed bundle into a scene: its model's text and meshes with all digits, not what MuJoCo makes of them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import mujoco
import numpy as np

from minexplore.bundle import (
    ROCK_TEXTURE,
    BundleError,
    GeomGroup,
    TriangleMesh,
    decode_msh,
    has_visible_rock,
    is_rough_floor,
    is_shade,
    puddle_geom,
)
from minexplore.physics.local_models import part_vertices
from minexplore.world import World, load_world
from pipeline.errors import ArtifactError
from pipeline.export.labels import part_label, surface_label, water_label
from pipeline.export.scene import UNITS, ConvexPart, ExportScene, Light, Material, Surface, WorldFacts, box_corners
from pipeline.mjcf.bundle import WorldRecord
from pipeline.remarks import warn_user

_PARTS = (GeomGroup.COLLISION, GeomGroup.FLOOR, GeomGroup.ROOF)


def read_scene(record: WorldRecord, world: World, licence: str) -> ExportScene:
    """Return the scene of a bundle that was opened and loaded.

    Surfaces are those that a world shows: the smooth one is left out where the rough one hides it, and so are the clear
    planes that darken hollows for MuJoCo's renderer.

    Raises
    ------
    ArtifactError
        If a file has changed since the bundle was checked.
    """
    try:
        spec = world.spec()
        texture = world.read(ROCK_TEXTURE) if has_visible_rock(world.record) else None
        surfaces = [_surface(spec, geom, world) for geom in spec.geoms if _is_surface(geom)]
    except BundleError as error:
        raise ArtifactError(str(error)) from error
    zones = [zone.name for zone in record.zones]
    solid = [geom for geom in spec.geoms if geom.group in _PARTS]
    parts = [_part(spec, geom, zones) for geom in solid if not is_rough_floor(geom.name)]
    if len(parts) < len(solid):
        warn_user("export: left out is the rough floor; robots stand on its level planes")
    materials = {material.name: material_of(material) for material in spec.materials}
    lights = [light_of(light) for light in spec.lights]
    return ExportScene(_facts(record, licence), parts, surfaces, materials, lights, texture)


def load_checked(folder: Path) -> World:
    """Return the world of a folder; a bundle that may not be loaded is an expected error."""
    try:
        return load_world(folder)
    except BundleError as error:
        raise ArtifactError(str(error)) from error


def _facts(record: WorldRecord, licence: str) -> WorldFacts:
    return WorldFacts(
        name=record.name,
        format=record.format,
        world_sha256=record.world_sha256,
        frames=record.frames,
        units=UNITS,
        T_world_mine=record.T_world_mine,
        height_m=record.height_m,
        areas=dataclasses.asdict(record.areas),
        licence=licence,
    )


def _part(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, zones: list[str]) -> ConvexPart:
    is_box = geom.type == mujoco.mjtGeom.mjGEOM_BOX
    corners = box_corners(np.array(geom.size)) if is_box else part_vertices(spec, geom)
    label = part_label(geom.name, geom.group, zones)
    return ConvexPart(geom.name, label.what, label.zone, float(geom.friction[0]), np.array(geom.pos), corners, is_box)


def _is_surface(geom: mujoco.MjsGeom) -> bool:
    return geom.group == GeomGroup.ROUGH_SURFACE and not is_shade(geom.name)


def _surface(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, world: World) -> Surface:
    zones = [zone.name for zone in world.floor_zones]
    if geom.type == mujoco.mjtGeom.mjGEOM_PLANE:
        label = water_label(next(zone for zone in zones if puddle_geom(zone) == geom.name))
        return Surface(geom.name, label.what, label.zone, geom.material, _rectangle(geom))
    label = surface_label(geom.meshname, zones)
    mesh = decode_msh(world.read(spec.mesh(geom.meshname).file))
    return Surface(geom.meshname, label.what, label.zone, geom.material, mesh)


def _rectangle(plane: mujoco.MjsGeom) -> TriangleMesh:
    """Return a level plane of a stated size as two triangles that face up."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [*plane.size[:2], 0.0] + plane.pos
    up = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (4, 1))
    return TriangleMesh(corners.astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]]), np.zeros((0, 2)), up)


def material_of(material: mujoco.MjsMaterial) -> Material:
    """Return the colour of a material of `mine.xml`."""
    textured = bool(material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB])
    red, green, blue, alpha = (round(float(value), 6) for value in material.rgba)
    return Material(material.name, (red, green, blue, alpha), textured, float(material.shininess))


def light_of(light: mujoco.MjsLight) -> Light:
    """Return a spot light of `mine.xml`."""
    red, green, blue = (round(float(value), 6) for value in light.diffuse)
    direction = np.array(light.dir) / np.linalg.norm(light.dir)
    return Light(light.name, np.array(light.pos), direction, float(light.cutoff), (red, green, blue))
