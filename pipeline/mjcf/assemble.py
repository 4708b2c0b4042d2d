"""The work of stage 5: build the sealed world bundle from the compiled geometry and the realism parameters."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import mujoco
import numpy as np

from minexplore.bundle import (
    CLEARANCE_GRID,
    ENTRANCE_CAMERA,
    FLOOR,
    FORMAT,
    FRAMES,
    FREE_SPACE,
    GEOM_GROUPS,
    NAV2_MAP,
    NAV2_PICTURE,
    NO_OVERLAY,
    OCTREE,
    OVERVIEW_CAMERA,
    PREVIEW,
    ROUGH_OVERLAY,
    TOPOLOGY,
    GeomGroup,
)
from minexplore.floors.floor import Floor
from minexplore.floors.floor_zones import zoned_box
from minexplore.floors.stretch import raise_m
from minexplore.schema.files import read_grid
from pipeline.errors import GeometryError
from pipeline.geometry.maps.occupancy import sheet_nav2_maps
from pipeline.geometry.openings.fit import filled_floor, without_openings
from pipeline.geometry.openings.shaft_parts import fence_parts, roof_slabs
from pipeline.geometry.rock.extrude import collect_parts
from pipeline.memory import give_back
from pipeline.mjcf.bundle import HeightFigures, WorldRecord, compile_bundle, seal_bundle
from pipeline.mjcf.floor_cover import cover_floor
from pipeline.mjcf.furniture import hang_furniture
from pipeline.mjcf.openings import show_openings
from pipeline.mjcf.render import render_camera
from pipeline.mjcf.scene import MineScene, ZoneStrip, place_lights, tile_zones, tilt_about_centre
from pipeline.mjcf.world import zoned_patches
from pipeline.params.realism import RealismParams
from pipeline.remarks import warn_user
from pipeline.store.codecs import Bundle, Meshes, encode
from pipeline.types import (
    NO_OPENINGS,
    ConvexParts,
    DriftNetwork,
    FreeSpace,
    Image,
    Occupancy,
    Openings,
    SolidExtent,
    Spawn,
    Survey,
)


def assemble_world(
    params: RealismParams,
    survey: Survey,
    free_space: FreeSpace,
    topology: DriftNetwork,
    extent: SolidExtent,
    collision: ConvexParts,
    floor: Floor,
    spawn: Spawn,
    smooth: Meshes,
    texture: Image,
    rough: Path | Bundle,
    occupancy: bytes,
    free_space_bt: bytes,
    map_png: bytes,
    map_yaml: bytes,
    openings: Openings = NO_OPENINGS,
) -> dict[str, Bundle]:
    """Return `world`: the files of the bundle by name.

    `rough` is the folder with the chunks of the rough surface, or these files by name. An empty `smooth` gives a world
    without visible rock, which has no texture and no preview either. The last four arguments enter the bundle as they
    are.
    """
    chunks = _chunks(rough)
    zones = tile_zones(params.zones, zoned_box(extent.world_m, floor))
    wet = params.floor if floor.is_flat else None  # water is level
    if params.rough_floor and not floor.is_flat:
        raise GeometryError("realism.rough_floor: want a level mine; the floor of one with heights is even")
    if params.floor and params.floor.puddles and not floor.is_flat:
        warn_user("realism.floor.puddles: a mine with heights shows none")
    scene = MineScene(
        name=survey.name,
        extent=extent,
        parts=_fenced(collision, openings, floor, params.fence_openings),
        rock_friction=params.rock_friction,
        floor_thickness_m=params.floor_thickness_m,
        zones=zones,
        lights=_lights(params, topology),
        smooth=smooth,
        rough=chunks,
        texture=texture,
        anchor_m=spawn.anchor_m,
        heading_rad=heading_at(topology, spawn.anchor_m),
        T_world_mine=tilt_about_centre(_tilt_deg(params, floor), extent.world_m),
        look=params.look,
        fittings=_fittings(params, free_space, topology, zones, chunks, extent.height_m, floor, openings)
        if smooth
        else {},
        puddles=tuple(zone.name for zone in zones if zone.name in wet.puddles) if wet else (),
        water_m=wet.water_m if wet else 0.0,
        floor=floor,
        openings=openings,
        is_rough=params.rough_floor,
    )
    give_back()  # of the fittings' making: compiling is what takes most
    files, model = compile_bundle(scene)
    give_back()
    if model is not None:
        files[PREVIEW] = encode(Path(PREVIEW), _preview(model, params.preview_width_px))
    files[FREE_SPACE] = encode(Path(FREE_SPACE), free_space)
    files[TOPOLOGY] = encode(Path(TOPOLOGY), topology)
    if not floor.is_flat:
        files[FLOOR] = encode(Path(FLOOR), floor)
    files |= {CLEARANCE_GRID: occupancy, OCTREE: free_space_bt, NAV2_PICTURE: map_png, NAV2_MAP: map_yaml}
    files |= _sheet_maps(occupancy, floor)
    return {"world": seal_bundle(files, _record(params, scene, free_space, topology, spawn), params.made_by)}


def _sheet_maps(occupancy: bytes, floor: Floor) -> dict[str, bytes]:
    """Return the files of a Nav2 map of each sheet, if there are several."""
    if len(floor.offset_m) == 1:
        return {}
    files: dict[str, bytes] = {}
    stated = read_grid(occupancy)
    grid = Occupancy(stated["free"], stated["clearance_m"], stated["origin_m"], float(stated["cell_m"]))
    for name, (pixels, text) in sheet_nav2_maps(grid, floor).items():
        picture = Path(name).with_suffix(".png")
        files |= {name: text.encode(), picture.name: encode(picture, pixels)}
    return files


def _fenced(parts: ConvexParts, openings: Openings, floor: Floor, fenced: bool) -> ConvexParts:
    """Return collision parts with fences round the openings, or round those that lean."""
    fences = fence_parts(openings, floor, fenced)
    if not fences:
        return parts
    more = collect_parts(fences)
    return ConvexParts(
        np.vstack([parts.vertices, more.vertices]),
        np.concatenate([parts.offsets, parts.offsets[-1] + more.offsets[1:]]).astype(np.int32),
    )


def _chunks(rough: Path | Bundle) -> Bundle:
    if isinstance(rough, Path):
        rough = {path.name: path.read_bytes() for path in sorted(rough.glob("*.msh"))}
    return {name: data for name, data in rough.items() if name.endswith(".msh")}


def _fittings(
    params: RealismParams,
    free_space: FreeSpace,
    topology: DriftNetwork,
    zones: list[ZoneStrip],
    rough: Bundle,
    height_m: float,
    floor: Floor,
    openings: Openings,
) -> Bundle:
    """Return the meshes of the visible floor, the furniture and the openings as `NAME.msh`."""
    free, whole = without_openings(free_space.polygon, openings), filled_floor(floor, openings)
    found: Bundle = show_openings(openings, whole, rough, height_m, params.fence_openings)
    if params.floor:
        cover = cover_floor(params.floor, free, topology, zones, whole, openings)
        found |= {name: encode(Path(f"{name}.msh"), mesh) for name, mesh in cover.items()}
    if params.furnish != "off":
        found |= hang_furniture(params.furniture[params.furnish], topology, rough, height_m, whole)
    return {f"{name}.msh": found[name] for name in sorted(found)}


def _lights(params: RealismParams, topology: DriftNetwork) -> list:
    lights = params.lights
    legs = [np.array(leg.stations_m) for leg in topology.legs]
    lines = [np.array(topology.main_drift_m)] if lights.along == "main_drift" else legs
    return place_lights(lines, lights.spacing_m, lights.height_m, lights.pitch_deg, lights.cutoff_deg, lights.count)


def heading_at(topology: DriftNetwork, place_m: tuple[float, float]) -> float:
    """Return the heading of the main drift, rad, at the point nearest to a place; it runs towards the drift's end."""
    line = np.array(topology.main_drift_m)
    nearest = int(np.linalg.norm(line - place_m, axis=1).argmin())
    dx, dy = line[min(nearest + 20, len(line) - 1)] - line[max(nearest - 20, 0)]
    return math.atan2(dy, dx)


def _record(
    params: RealismParams, scene: MineScene, free_space: FreeSpace, topology: DriftNetwork, spawn: Spawn
) -> WorldRecord:
    west, _, east, _ = scene.extent.world_m
    tilt_deg = _tilt_deg(params, scene.floor)
    slope = math.sin(math.radians(tilt_deg))
    heights = None if scene.floor.is_flat else _heights(scene)
    return WorldRecord(
        format=FORMAT,
        name=scene.name,
        frames=FRAMES,
        T_world_mine=scene.T_world_mine.tolist(),
        tilt_deg=tilt_deg,
        gain_m={
            "entrance_region": round(slope * params.entrance_length_m, 3),
            "entrance_length": params.entrance_length_m,
            "whole_frame": round(slope * (east - west) if heights is None else heights.high_m - heights.low_m, 3),
        },
        height_m=scene.extent.height_m,
        world_m=scene.extent.world_m,
        plan_frame=free_space.frame,
        areas=free_space.areas,
        zones=scene.zones,
        rock_friction=scene.rock_friction,
        lights=len(scene.lights),
        collision_parts=len(scene.parts),
        loops=topology.loops,
        drifts=len(topology.legs),
        spawn=spawn,
        geom_groups=GEOM_GROUPS,
        overlay=ROUGH_OVERLAY if scene.has_visible_rock else NO_OVERLAY,
        files={},
        world_sha256="",
        look=scene.look,
        heights=heights,
        openings=scene.openings.shafts,
        fenced=params.fence_openings,
        rough_floor=scene.is_rough,
    )


def _tilt_deg(params: RealismParams, floor: Floor) -> float:
    """Return the tilt of the mine; one with heights of its own has none."""
    return params.tilt_deg if floor.is_flat else 0.0


def _heights(scene: MineScene) -> HeightFigures:
    floor, height_m = scene.floor, scene.extent.height_m
    roof_m = raise_m(height_m, floor.stretch)
    return HeightFigures(
        low_m=float(floor.vertices[:, 2].min()),
        high_m=float(floor.vertices[:, 2].max()),
        steepest_deg=round(float(floor.steepness_deg().max()), 3),
        sheets=len(floor.offset_m),
        floor_wedges=len(zoned_patches(floor, scene.zones)),
        roof_wedges=len(roof_slabs(floor, height_m, scene.openings)),
        roof_m=(round(float(roof_m.min()), 6), round(float(roof_m.max()), 6)) if floor.is_stretched else None,
    )


def _preview(model: mujoco.MjModel, width_px: int) -> Image:
    """Return two views, one below the other: the mine from above, and the view from the entrance."""
    solid, visible = (GeomGroup.FLOOR, GeomGroup.COLLISION), (GeomGroup.FLOOR, GeomGroup.ROUGH_SURFACE)
    overview = render_camera(model, OVERVIEW_CAMERA, width_px, width_px * 9 // 16, solid, spots=False)
    rows = np.flatnonzero((overview != overview[0, 0]).any(axis=(1, 2)))
    entrance = render_camera(model, ENTRANCE_CAMERA, width_px, width_px * 7 // 16, visible)
    return cv2.vconcat([overview[rows[0] : rows[-1] + 1], entrance])
