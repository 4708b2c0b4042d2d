"""Stage 5's work: from compiled geometry and the realism parameters to the sealed world bundle."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import mujoco
import numpy as np

from minexplore.bundle import FORMAT
from pipeline.mjcf.bundle import WorldRecord, compile_bundle, seal_bundle
from pipeline.mjcf.render import render_camera
from pipeline.mjcf.world import (
    BACK_GROUP,
    BASE_GROUP,
    GROUND_GROUP,
    ROCK_GROUP,
    SURFACE_GROUP,
    MineScene,
    place_lights,
    tile_zones,
    tilt_about_centre,
)
from pipeline.params.realism import RealismParams
from pipeline.store.codecs import Bundle, Meshes, encode
from pipeline.types import ConvexParts, DriftNetwork, FreeSpace, Image, Rock, Spawn, Survey

_FRAMES = {
    "mine": "x east, y north, z up from the sill, origin at the survey's origin; plan and geometry are stated in it",
    "world": "MuJoCo's: the mine frame's centre at its origin, the mine tilted about Y; gravity is -z",
}


def assemble_world(
    params: RealismParams,
    survey: Survey,
    free_space: FreeSpace,
    topology: DriftNetwork,
    rock: Rock,
    collision: ConvexParts,
    spawn: Spawn,
    meshes: Meshes,
    texture: Image,
    overlay: Path | Bundle,
    **companions: bytes,
) -> dict[str, Bundle]:
    """Return `world`: the bundle's files by name.

    `overlay` is the folder of the displaced layer's chunks, or those files by name. `companions` are files that
    travel with the world as they are: `map_png` becomes `map.png`.
    """
    scene = MineScene(
        name=survey.name,
        rock=rock,
        parts=collision,
        rock_friction=params.rock_friction,
        floor_thickness_m=params.floor_thickness_m,
        zones=tile_zones([(z.name, z.friction, z.rgba) for z in params.zones], rock.world_m),
        lights=_lights(params, topology),
        base=meshes,
        overlay={p.name: p.read_bytes() for p in sorted(overlay.glob("*.msh"))}
        if isinstance(overlay, Path)
        else overlay,
        texture=texture,
        anchor_m=spawn.anchor_m,
        heading_rad=_heading_at(topology, spawn.anchor_m),
        T_world_mine=tilt_about_centre(params.tilt_deg, rock.world_m),
    )
    files = compile_bundle(scene)
    files["preview.png"] = encode(Path("preview.png"), _preview(files, params.preview_width_px))
    files["free_space.geojson"] = encode(Path("free_space.geojson"), free_space)
    files["topology.json"] = encode(Path("topology.json"), topology)
    files |= {".".join(name.rsplit("_", 1)): data for name, data in companions.items()}
    return {"world": seal_bundle(files, _record(params, scene, free_space, topology, spawn))}


def _lights(params: RealismParams, topology: DriftNetwork) -> list:
    look = params.lights
    legs = [np.array(leg.stations_m) for leg in topology.legs]
    lines = [np.array(topology.main_drift_m)] if look.along == "main_drift" else legs
    return place_lights(lines, look.spacing_m, look.height_m, look.pitch_deg, look.cutoff_deg, look.count)


def _heading_at(topology: DriftNetwork, place_m: tuple[float, float]) -> float:
    """Return the main drift's heading, rad, where it passes nearest to a place, towards its far end."""
    line = np.array(topology.main_drift_m)
    at = int(np.linalg.norm(line - place_m, axis=1).argmin())
    dx, dy = line[min(at + 20, len(line) - 1)] - line[max(at - 20, 0)]
    return math.atan2(dy, dx)


def _record(
    params: RealismParams, scene: MineScene, free_space: FreeSpace, topology: DriftNetwork, spawn: Spawn
) -> WorldRecord:
    west, _, east, _ = scene.rock.world_m
    slope = math.sin(math.radians(params.tilt_deg))
    return WorldRecord(
        format=FORMAT,
        name=scene.name,
        frames=_FRAMES,
        T_world_mine=scene.T_world_mine.tolist(),
        tilt_deg=params.tilt_deg,
        gain_m={
            "entrance_region": round(slope * params.entrance_length_m, 3),
            "entrance_length": params.entrance_length_m,
            "whole_frame": round(slope * (east - west), 3),
        },
        height_m=scene.rock.height_m,
        world_m=scene.rock.world_m,
        plan_frame=free_space.frame,
        areas=free_space.areas,
        zones=scene.zones,
        rock_friction=scene.rock_friction,
        lights=len(scene.lights),
        collision_parts=len(scene.parts),
        loops=topology.loops,
        drifts=len(topology.legs),
        spawn=spawn,
        geom_groups={
            "floor": GROUND_GROUP,
            "surface": SURFACE_GROUP,
            "rock": ROCK_GROUP,
            "back": BACK_GROUP,
            "base": BASE_GROUP,
        },
        files={},
        world_sha256="",
    )


def _preview(files: Bundle, width_px: int) -> Image:
    """Return the mine from above over the view from the entrance."""
    model = mujoco.MjModel.from_xml_string(files["mine.xml"].decode(), _assets(files))
    above = render_camera(model, "overview", width_px, width_px * 9 // 16, (GROUND_GROUP, ROCK_GROUP), spots=False)
    rows = np.flatnonzero((above != above[0, 0]).any(axis=(1, 2)))
    inside = render_camera(model, "entrance", width_px, width_px * 7 // 16, (GROUND_GROUP, SURFACE_GROUP))
    return cv2.vconcat([above[rows[0] : rows[-1] + 1], inside])


def _assets(files: Bundle) -> Bundle:
    return {name: data for name, data in files.items() if name != "mine.xml"}
