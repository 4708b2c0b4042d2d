"""Read a sealed bundle into a scene: its model's text and meshes with all digits, not what MuJoCo makes of them."""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from pathlib import Path

import mujoco
import numpy as np

from minesurveys.remarks import warn_user
from minexplore.bundle import (
    ROCK_TEXTURE,
    BundleError,
    GeomGroup,
    TriangleMesh,
    ground_material,
    has_visible_rock,
    is_rough_floor,
    is_shade,
    puddle_geom,
)
from minexplore.physics.local_models import part_vertices
from minexplore.world import World, load_world
from pipeline.errors import ArtifactError
from pipeline.export.labels import part_label, seen_label, surface_label, water_label
from pipeline.export.scene import (
    UNITS,
    ConvexPart,
    ExportScene,
    Light,
    Material,
    Surface,
    WorldFacts,
    box_corners,
    hull_triangles,
)
from pipeline.mjcf.bundle import WorldRecord
from pipeline.volume.world.record import VolumeRecord

ROCK = "rock"  # the material of walls and roofs in `mine.xml`
_PARTS = (GeomGroup.COLLISION, GeomGroup.FLOOR, GeomGroup.ROOF)


def read_scene(record: WorldRecord, world: World, licence: str) -> ExportScene:
    """Return the scene of a bundle that was opened and loaded.

    Surfaces are those that a world shows: the smooth one is left out where the rough one hides it, and so are the clear
    planes that darken hollows for MuJoCo's renderer. A world without visible rock shows its collision parts.

    Raises
    ------
    ArtifactError
        If a file has changed since the bundle was checked.
    """
    try:
        spec = world.spec()
        texture = world.read(ROCK_TEXTURE) if has_visible_rock(world.record) else None
        surfaces = surfaces_of(spec, world)
    except BundleError as error:
        raise ArtifactError(str(error)) from error
    zones = [zone.name for zone in record.zones]
    solid = [geom for geom in spec.geoms if geom.group in _PARTS]
    parts = [_part(spec, geom, zones) for geom in solid if not is_rough_floor(geom.name)]
    if len(parts) < len(solid):
        warn_user("export: left out is the rough floor; robots stand on its level planes")
    materials = {material.name: material_of(material) for material in spec.materials}
    lights = [light_of(light) for light in spec.lights]
    surfaces = surfaces if has_visible_rock(world.record) else _bare(parts)
    return ExportScene(facts_of(record, record.height_m, licence), parts, surfaces, materials, lights, texture)


def load_checked(folder: Path) -> World:
    """Return the world of a folder; a bundle that may not be loaded is an expected error."""
    try:
        return load_world(folder)
    except BundleError as error:
        raise ArtifactError(str(error)) from error


def facts_of(record: WorldRecord | VolumeRecord, height_m: float, licence: str) -> WorldFacts:
    """Return what an export states of a world besides its geometry."""
    return WorldFacts(
        name=record.name,
        format=record.format,
        world_sha256=record.world_sha256,
        frames=record.frames,
        units=UNITS,
        T_world_mine=record.T_world_mine,
        height_m=height_m,
        areas=dataclasses.asdict(record.areas),
        licence=licence,
    )


def _part(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, zones: list[str]) -> ConvexPart:
    is_box = geom.type == mujoco.mjtGeom.mjGEOM_BOX
    corners = box_corners(np.array(geom.size)) if is_box else part_vertices(spec, geom)
    label = part_label(geom.name, geom.group, zones)
    return ConvexPart(geom.name, label.what, label.zone, float(geom.friction[0]), np.array(geom.pos), corners, is_box)


def _bare(parts: list[ConvexPart]) -> list[Surface]:
    """Return the parts as they are seen, one surface for each label and zone."""
    seen: dict[tuple[str, str], list[np.ndarray]] = defaultdict(list)
    for part in parts:
        seen[seen_label(part.label), part.zone].append(hull_triangles(part))
    return [
        Surface(
            f"{what}_{k}", what, zone, ground_material(zone) if zone else ROCK, flat_mesh(np.concatenate(triangles))
        )
        for k, ((what, zone), triangles) in enumerate(seen.items())
    ]


def flat_mesh(triangles_m: np.ndarray) -> TriangleMesh:
    """Return triangles (n, 3, 3) m that face those who see them, each with corners and normals of its own."""
    a, b, c = (triangles_m[:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    vertices, faces = triangles_m.reshape(-1, 3).astype(np.float32), np.arange(3 * len(triangles_m)).reshape(-1, 3)
    return TriangleMesh(vertices, faces, np.zeros((0, 2)), np.repeat(normal, 3, axis=0).astype(np.float32))


def surfaces_of(spec: mujoco.MjSpec, world: World) -> list[Surface]:
    """Return what is seen of rock, fittings and water in a model; shade is none of it."""
    seen = [geom for geom in spec.geoms if geom.group == GeomGroup.ROUGH_SURFACE and not is_shade(geom.name)]
    return [_surface(spec, geom, world) for geom in seen]


def _surface(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, world: World) -> Surface:
    zones = [zone.name for zone in world.floor_zones]
    flooded = next((zone for zone in zones if puddle_geom(zone) == geom.name), None)
    is_plane = geom.type == mujoco.mjtGeom.mjGEOM_PLANE
    mesh = _rectangle(geom) if is_plane else world.mesh(spec.mesh(geom.meshname).file)
    if flooded is not None:
        label = water_label(flooded)
        mesh = mesh if is_plane else dataclasses.replace(mesh, vertices=mesh.vertices + np.float32(geom.pos))
        return Surface(geom.name, label.what, label.zone, geom.material, mesh)
    label = surface_label(geom.meshname, zones)
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
