"""The world as an `MjSpec`: one tilted body with collision rock, floor zones, roof, surfaces, lights and cameras."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np

from minexplore.bundle import (
    BARE_ROCK_RGBA,
    ENTRANCE_CAMERA,
    FLOOR_CHAMFER,
    MINE_BODY,
    OVERVIEW_CAMERA,
    ROCK_CLASS,
    ROCK_TEXTURE,
    ROOF,
    ROOF_GEOM,
    SURFACE_BODY,
    SURFACE_CLASS,
    WALLS,
    GeomGroup,
    ground_material,
    hfield_file,
    mesh_file,
    rock_geom,
    smooth_mesh,
    spot_light,
    surface_geom,
)
from minexplore.looks import CUT_MATERIAL, CUT_RGBA, EXTENT_M, LOOKS, PLAIN
from pipeline.mjcf.fittings import add_fittings
from pipeline.mjcf.scene import MineScene
from pipeline.store.codecs import Bundle, encode
from pipeline.types import ConvexParts

_VISIBLE_PIECES = (FLOOR_CHAMFER, WALLS, ROOF)  # not the flat floor: the floor zones show it


def build_spec(scene: MineScene) -> mujoco.MjSpec:
    """Build the specification of a world.

    Returns
    -------
    mujoco.MjSpec
        Asset files are named `meshes/*.msh` and `textures/rock.png`; `spec.assets` holds their bytes.
    """
    spec = mujoco.MjSpec()
    spec.modelname = scene.name
    # The given values have all digits; compiled values have six: findings/mujoco-to-xml-keeps-six-digits.sh.
    spec.compiler.savecompiled = False
    _set_view(spec, scene)
    mine = spec.worldbody.add_body(name=MINE_BODY)
    tilt = math.atan2(scene.T_world_mine[0, 2], scene.T_world_mine[0, 0])
    mine.quat = [math.cos(tilt / 2), 0.0, math.sin(tilt / 2), 0.0]
    mine.pos = scene.T_world_mine[:3, 3]
    _add_rock_class(spec, scene)
    _add_rock(spec, mine, scene.parts)
    _add_floor(spec, mine, scene)
    _add_roof(spec, mine, scene)
    if scene.has_visible_rock:
        meshes = _add_surface(spec, mine, scene) | add_fittings(spec, mine, scene)
        fields = _add_rough_floor(spec, mine, scene) if scene.is_rough else {}
        spec.assets = {**meshes, ROCK_TEXTURE: scene.texture, **fields}
    for i, light in enumerate(scene.lights):
        mine.add_light(
            name=spot_light(i),
            pos=light.place_m,
            dir=light.direction,
            type=mujoco.mjtLightType.mjLIGHT_SPOT,
            cutoff=light.cutoff_deg,
            exponent=8.0,
            castshadow=False,
            attenuation=[1.0, 0.0, 0.004],
            diffuse=[1.0, 0.93, 0.8],
            specular=[0.1, 0.1, 0.1],
        )
    _add_cameras(mine, scene)
    return spec


def _set_view(spec: mujoco.MjSpec, scene: MineScene) -> None:
    # Clipping planes scale with the extent. With the extent of a drift, near walls and the far end are both visible.
    look = LOOKS[scene.look]
    spec.stat.extent = EXTENT_M
    spec.stat.center = (scene.T_world_mine @ [*scene.anchor_m, 0.5, 1.0])[:3].round(3)
    spec.visual.map.znear = 0.005
    spec.visual.map.zfar = 200.0
    spec.visual.headlight.ambient = [look.ambient] * 3
    spec.visual.headlight.diffuse = [look.diffuse] * 3
    spec.visual.headlight.specular = [look.glint] * 3
    if look.hazy:
        spec.visual.map.fogstart, spec.visual.map.fogend = (distance / EXTENT_M for distance in look.haze_m)
        spec.visual.rgba.fog = [*look.haze_rgb, 1.0]
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1920, 1080


def _add_rock_class(spec: mujoco.MjSpec, scene: MineScene) -> None:
    look = LOOKS[scene.look]
    rock = spec.add_material(name="rock", specular=look.specular, shininess=look.shininess)
    if scene.has_visible_rock:
        spec.add_texture(name="rock", type=mujoco.mjtTexture.mjTEXTURE_2D, file=ROCK_TEXTURE)
        rock.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "rock"
    else:
        rock.rgba = BARE_ROCK_RGBA
    if scene.look != PLAIN:
        # Collision parts have no texture coordinates: a texture would run over them in streaks.
        spec.add_material(name=CUT_MATERIAL, rgba=CUT_RGBA, specular=0.0, shininess=0.0)
    solid = spec.add_default(ROCK_CLASS, spec.default)
    solid.geom.group = GeomGroup.COLLISION
    solid.geom.material = "rock" if scene.look == PLAIN else CUT_MATERIAL
    solid.geom.friction = [scene.rock_friction, 0.005, 0.0001]
    if not scene.has_visible_rock:
        return
    visible = spec.add_default(SURFACE_CLASS, spec.default)
    visible.geom.type, visible.geom.group, visible.geom.material = (
        mujoco.mjtGeom.mjGEOM_MESH,
        GeomGroup.ROUGH_SURFACE,
        "rock",
    )
    visible.geom.contype, visible.geom.conaffinity = 0, 0


def _add_rock(spec: mujoco.MjSpec, mine: mujoco.MjsBody, parts: ConvexParts) -> None:
    for i in range(len(parts)):
        centre = _add_part(spec, rock_geom(i), parts[i])
        mine.add_geom(
            spec.find_default(ROCK_CLASS),
            name=rock_geom(i),
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=rock_geom(i),
            pos=centre,
        )


def _add_part(spec: mujoco.MjSpec, name: str, vertices: np.ndarray) -> np.ndarray:
    """Add a convex part as a mesh about its centre, and return the centre.

    MuJoCo stores mesh vertices in 32 bits, positions in 64: findings/mujoco-mesh-corners-of-32-bits.sh.
    """
    centre: np.ndarray = ((vertices.min(axis=0) + vertices.max(axis=0)) / 2).round(4)
    spec.add_mesh(name=name, uservert=(vertices - centre).ravel().tolist())
    return centre


def _add_floor(spec: mujoco.MjSpec, mine: mujoco.MjsBody, scene: MineScene) -> None:
    for zone in scene.zones:
        # OpenGL lights vertices, and those of a large floor are far from every lamp, so the floor emits a little light.
        spec.add_material(name=ground_material(zone.name), rgba=zone.rgba, emission=0.25, specular=0.0, shininess=0.0)
        centre = [(zone.west_m + zone.east_m) / 2, (zone.south_m + zone.north_m) / 2, -scene.floor_thickness_m / 2]
        size = [(zone.east_m - zone.west_m) / 2, (zone.north_m - zone.south_m) / 2, scene.floor_thickness_m / 2]
        # Without priority MuJoCo uses the larger friction of two geoms, so that water would not affect a rubber wheel.
        mine.add_geom(
            name=zone.geom,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=centre,
            size=size,
            material=ground_material(zone.name),
            priority=1,
            friction=[zone.friction, 0.005, 0.0001],
            group=GeomGroup.FLOOR,
        )


def _add_rough_floor(spec: mujoco.MjSpec, mine: mujoco.MjsBody, scene: MineScene) -> Bundle:
    """Add height fields that follow the visible floor; return their files."""
    from pipeline.mjcf.rough_floor import hfield_files, rough_tiles  # open3d takes a second to load

    tiles = rough_tiles({Path(name).stem: data for name, data in scene.fittings.items()}, scene.zones)
    for tile in tiles:
        tile.add_to(spec, mine, [scene.zones[tile.zone].friction, 0.005, 0.0001], hfield_file(tile.name))
    return hfield_files(tiles)


def _add_roof(spec: mujoco.MjSpec, mine: mujoco.MjsBody, scene: MineScene) -> None:
    west, south, east, north = scene.extent.world_m
    mine.add_geom(
        spec.find_default(ROCK_CLASS),
        name=ROOF_GEOM,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        group=GeomGroup.ROOF,
        pos=[(west + east) / 2, (south + north) / 2, scene.extent.height_m + scene.floor_thickness_m / 2],
        size=[(east - west) / 2, (north - south) / 2, scene.floor_thickness_m / 2],
    )


def _add_surface(spec: mujoco.MjSpec, mine: mujoco.MjsBody, scene: MineScene) -> Bundle:
    """Add both surfaces to a separate body, which collision detection skips as a whole; return the mesh files."""
    surface = mine.add_body(name=SURFACE_BODY)
    files = {smooth_mesh(k): encode(Path(f"{k}.msh"), mesh) for k, mesh in scene.smooth.items() if k in _VISIBLE_PIECES}
    for name in files:
        _add_surface_mesh(spec, surface, name, GeomGroup.SMOOTH_SURFACE if scene.rough else GeomGroup.ROUGH_SURFACE)
    chunks = {name.removesuffix(".msh"): data for name, data in sorted(scene.rough.items())}
    for name in chunks:
        _add_surface_mesh(spec, surface, name, GeomGroup.ROUGH_SURFACE)
    return {mesh_file(name): data for name, data in (files | chunks).items()}


def _add_surface_mesh(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, group: int) -> None:
    # An open surface has no volume, so MuJoCo needs the inertia of a thin shell; nothing uses it.
    spec.add_mesh(name=name, file=mesh_file(name), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
    body.add_geom(spec.find_default(SURFACE_CLASS), name=surface_geom(name), meshname=name, group=group)


def _add_cameras(mine: mujoco.MjsBody, scene: MineScene) -> None:
    west, south, east, north = scene.extent.world_m
    c, s = math.cos(scene.heading_rad), math.sin(scene.heading_rad)
    mine.add_camera(
        name=ENTRANCE_CAMERA,
        pos=(*scene.anchor_m, 1.2),
        quat=_camera_quat((s, -c, 0.0), (0.0, 0.0, 1.0)),
        fovy=70.0,
    )
    # The whole mine from above, slightly from the south; the roof faces down and does not hide the drifts.
    pitch, fovy = math.radians(60.0), 30.0
    reach = max((east - west) / 16 * 9, north - south) / 2 / math.tan(math.radians(fovy / 2)) * 1.05
    centre = np.array([(west + east) / 2, (south + north) / 2, 0.0])
    up = (0.0, math.sin(pitch), math.cos(pitch))
    place = centre + reach * np.array([0.0, -math.cos(pitch), math.sin(pitch)])
    mine.add_camera(name=OVERVIEW_CAMERA, pos=place.round(2), quat=_camera_quat((1.0, 0.0, 0.0), up), fovy=fovy)


def _camera_quat(right: tuple[float, float, float], up: tuple[float, float, float]) -> np.ndarray:
    """Return the quaternion of a camera with these axes; it points along up x right."""
    axes = np.column_stack([right, up, np.cross(right, up)])
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, axes.ravel())
    return quat
