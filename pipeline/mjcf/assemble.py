"""The work of stage 5: build the sealed world bundle from the compiled geometry and the realism parameters."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from minexplore.bundle import (
    CLEARANCE_GRID,
    FORMAT,
    FRAMES,
    FREE_SPACE,
    GEOM_GROUPS,
    MODEL,
    NAV2_MAP,
    NAV2_PICTURE,
    NO_OVERLAY,
    OCTREE,
    PREVIEW,
    ROUGH_OVERLAY,
    TOPOLOGY,
)
from pipeline.mjcf.bundle import WorldRecord, compile_bundle, seal_bundle
from pipeline.mjcf.floor.cover import cover_floor
from pipeline.mjcf.floor.grid import level_grid
from pipeline.mjcf.furniture import hang_furniture, on_level, ways_of
from pipeline.mjcf.render import render_preview
from pipeline.mjcf.scene import MineScene, level_lines, place_lights, tile_zones, tilt_about_centre
from pipeline.mjcf.visible import compile_visible, compile_with, in_sight
from pipeline.params.realism import RealismParams
from pipeline.places import COLLISION, EXTENT, SMOOTH, SPAWN, TEXTURE
from pipeline.progress import progress
from pipeline.store.codecs import Bundle, Meshes, decode, encode
from pipeline.store.palette_png import encode_texture
from pipeline.types import (
    ConvexParts,
    DriftNetwork,
    FreeSpace,
    Image,
    SolidExtent,
    Spawn,
    Survey,
)

_COPIED = (CLEARANCE_GRID, NAV2_MAP, NAV2_PICTURE, OCTREE)


def assemble_world(
    params: RealismParams,
    survey: Survey,
    free_space: FreeSpace,
    topology: DriftNetwork,
    compiled: Path,
    rock: Path,
) -> Bundle:
    """Return the files of the bundle by name.

    Parameters
    ----------
    params : RealismParams
    survey : Survey
    free_space : FreeSpace
    topology : DriftNetwork
    compiled : Path
        The folder of stage 3: collision parts, extent, spawn, and maps that enter the bundle as they are.
    rock : Path
        The folder of stage 4. An empty one gives a world without visible rock, which has no texture and no preview.
    """
    extent: SolidExtent = decode(compiled / EXTENT, SolidExtent)
    spawn: Spawn = decode(compiled / SPAWN, Spawn)
    smooth: Meshes = decode(rock / SMOOTH, Meshes) if (rock / SMOOTH).exists() else {}
    chunks = {path.name: path.read_bytes() for path in sorted(rock.glob("*.msh"))}
    zones = tile_zones(params.zones, extent.world_m)
    wet = params.floor
    with progress("realism", 3, "steps") as done:
        scene = MineScene(
            name=survey.name,
            extent=extent,
            parts=decode(compiled / COLLISION, ConvexParts),
            rock_friction=params.rock_friction,
            floor_thickness_m=params.floor_thickness_m,
            zones=zones,
            lights=_lights(params, topology),
            smooth=smooth,
            rough=chunks,
            texture=encode_texture(decode(rock / TEXTURE, Image)) if smooth else b"",
            anchor_m=spawn.anchor_m,
            heading_rad=heading_at(topology, spawn.anchor_m),
            T_world_mine=tilt_about_centre(params.tilt_deg, extent.world_m),
            look=params.look,
            fittings=_fittings(params, free_space, topology, extent, chunks) if smooth else {},
            puddles=tuple(zone.name for zone in zones if zone.name in wet.puddles) if wet else (),
            water_m=wet.water_m if wet else 0.0,
            is_rough=params.rough_floor,
        )
        done.update()
        files, spec = compile_bundle(scene)
        done.update()
        if spec is not None:
            visible = compile_visible(spec, Path(MODEL))
            seen = in_sight(visible, free_space.polygon, [np.array(scene.anchor_m)])
            model = compile_with(spec, Path(MODEL), seen)
            files[PREVIEW] = encode(Path(PREVIEW), render_preview(model, params.preview_width_px))
        done.update()
    files[FREE_SPACE] = encode(Path(FREE_SPACE), free_space)
    files[TOPOLOGY] = encode(Path(TOPOLOGY), topology)
    files |= {name: (compiled / name).read_bytes() for name in _COPIED}
    return seal_bundle(files, _record(params, scene, free_space, topology, spawn), params.made_by)


def _fittings(
    params: RealismParams,
    free_space: FreeSpace,
    topology: DriftNetwork,
    extent: SolidExtent,
    rough: Bundle,
) -> Bundle:
    """Return the meshes of the visible floor and the furniture as `NAME.msh`."""
    found: Bundle = {}
    if params.furnish != "off":
        ways, main_m = ways_of(topology, extent.height_m), on_level(topology.main_drift_m)
        found |= hang_furniture(params.furniture[params.furnish], ways, main_m, rough)
    if params.floor is not None:
        grid = level_grid(params.floor, free_space.polygon, topology)
        floor = cover_floor(params.floor, grid, tile_zones(params.zones, extent.world_m))
        found |= {name: encode(Path(f"{name}.msh"), mesh) for name, mesh in floor.items()}
    return {f"{name}.msh": found[name] for name in sorted(found)}


def _lights(params: RealismParams, topology: DriftNetwork) -> list:
    lights = params.lights
    lines = level_lines(topology, lights.along)
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
    slope = math.sin(math.radians(params.tilt_deg))
    return WorldRecord(
        format=FORMAT,
        name=scene.name,
        frames=FRAMES,
        T_world_mine=scene.T_world_mine.tolist(),
        tilt_deg=params.tilt_deg,
        gain_m={
            "entrance_region": round(slope * params.entrance_length_m, 3),
            "entrance_length": params.entrance_length_m,
            "whole_frame": round(slope * (east - west), 3),
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
        rough_floor=scene.is_rough,
    )
