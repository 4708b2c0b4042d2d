"""The work of stage 5 for a volume world: its sealed bundle of format /3."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from minexplore.bundle import (
    CELLS,
    FRAMES,
    GEOM_GROUPS,
    MADE_BY,
    MESHES,
    MODEL,
    NO_OVERLAY,
    PARTS,
    PREVIEW,
    RECORD,
    ROUGH_OVERLAY,
    TOPOLOGY,
    VOLUME,
    VOLUME_FORMAT,
    decode_msh,
    mesh_file,
    world_sha256,
)
from minexplore.floors.volume_arrays import FacetLabel, FloorSpans, Parts, VolumeFacets
from pipeline.mjcf.scene import tile_zones
from pipeline.params.realism import RealismParams
from pipeline.places import SPAWN
from pipeline.store.codecs import Bundle, decode, encode
from pipeline.store.files import adapter_of
from pipeline.store.hashing import sha256_bytes
from pipeline.types import FreeSpace, Survey
from pipeline.volume.world.compile import BUILT
from pipeline.volume.world.content import world_box
from pipeline.volume.world.drifts.lamps import lights_of
from pipeline.volume.world.floor.cover import lay_floor
from pipeline.volume.world.model import VolumeScene, eye_over, model_xml
from pipeline.volume.world.parts import cut_floors
from pipeline.volume.world.record import BuiltVolume, VolumeFigures, VolumeRecord
from pipeline.volume.world.surface.furnished import hang_in_volume
from pipeline.volume.world.surface.show import chunk_names, is_painted, rock_files, rock_names
from pipeline.volume.world.surface.views import draw_preview
from pipeline.volume.world.topology import LegNetwork, Start, heading_at

_OWN = (SPAWN, BUILT)  # of the stage's folder, which the record holds


def bundle_volume(
    params: RealismParams,
    survey: Survey,
    free_space: FreeSpace,
    compiled: Path,
    rock: Path | None = None,
) -> Bundle:
    """Return the files of the bundle by name.

    Parameters
    ----------
    params : RealismParams
    survey : Survey
    free_space : FreeSpace
        The plan view.
    compiled : Path
        The folder with the files of `compile_volume`.
    rock : Path, optional
        The folder with the chunks of the visible rock and their texture; it may be empty.
    """
    seen = rock_files(rock) if rock else {}
    legs: LegNetwork = decode(compiled / TOPOLOGY, LegNetwork)
    cells: FloorSpans = decode(compiled / CELLS, FloorSpans)
    if seen and params.furnish != "off":
        chunks = {name: data for name, data in seen.items() if name.startswith(MESHES)}
        hung = hang_in_volume(params.furniture[params.furnish], legs, chunks, cells)
        seen |= {mesh_file(name): data for name, data in hung.items()}
    volume: VolumeFacets = decode(compiled / VOLUME, VolumeFacets)
    start: Start = decode(compiled / SPAWN, Start)
    box = world_box(volume)
    west, south, east, north = box
    zones = tile_zones(params.zones, box)
    if seen and params.floor is not None:
        laid = lay_floor(params.floor, volume, legs, zones)
        seen |= {mesh_file(name): encode(Path(mesh_file(name)), mesh) for name, mesh in laid.items()}
    parts = cut_floors(decode(compiled / PARTS, Parts), [zone.east_m for zone in zones[:-1]], volume)
    scene = VolumeScene(
        name=survey.name,
        parts=parts,
        zones=zones,
        rock_friction=params.rock_friction,
        lights=lights_of(params.lights, legs),
        look=params.look,
        anchor_m=start.anchor_m,
        eye_m=eye_over(cells, start.anchor_m),
        heading_rad=heading_at(legs, start.anchor_m),
        world_m=box,
        offset_m=np.array([-(west + east) / 2, -(south + north) / 2, 0.0]),
        rock=chunk_names(seen),
        water_m=params.floor.water_m if params.floor else 0.0,
        is_painted=is_painted(decode_msh(seen[name]).texcoords for name in rock_names(seen)),
    )
    names = sorted(path.name for path in compiled.iterdir() if path.name not in _OWN)
    files = {name: (compiled / name).read_bytes() for name in names}
    files |= {MODEL: model_xml(scene), PARTS: encode(Path(PARTS), parts), **seen}
    built: BuiltVolume = decode(compiled / BUILT, BuiltVolume)
    record = _record(params, scene, free_space, legs, start, _figures(volume, parts, cells, built))
    if seen:
        preview = draw_preview(seal(files, record, params), record, free_space.polygon, params.preview_width_px)
        files[PREVIEW] = encode(Path(PREVIEW), preview)
    return seal(files, record, params)


def seal(files: Bundle, record: VolumeRecord, params: RealismParams) -> Bundle:
    """Add `world.json`, with the sha256 of each file and the world's hash over both, and `made_by.json`."""
    fields = adapter_of(VolumeRecord).dump_python(record, mode="json")
    fields["files"] = {name: sha256_bytes(data) for name, data in sorted(files.items())}
    fields["world_sha256"] = world_sha256(fields)
    made_by = params.made_by.model_dump(mode="json")
    return {**files, RECORD: encode(Path(RECORD), fields), MADE_BY: encode(Path(MADE_BY), made_by)}


def _figures(volume: VolumeFacets, parts: Parts, cells: FloorSpans, built: BuiltVolume) -> VolumeFigures:
    return VolumeFigures(
        facets=len(volume.faces),
        vertices=len(volume.vertices),
        parts=len(parts),
        floors=int((parts.label == FacetLabel.FLOOR).sum()),
        storeys=int(cells.storey.max(initial=-1)) + 1,
        low_m=round(float(volume.vertices[:, 2].min()), 6),
        high_m=round(float(volume.vertices[:, 2].max()), 6),
        surveyed_m=built.surveyed_m,
        piece_m=built.piece_m,
        built_m=built.built_m,
        datum_m=built.datum_m,
        entrances=built.entrances,
        closed_ends=built.closed_ends,
        is_drawn=built.is_drawn,
    )


def _record(
    params: RealismParams,
    scene: VolumeScene,
    free_space: FreeSpace,
    legs: LegNetwork,
    start: Start,
    figures: VolumeFigures,
) -> VolumeRecord:
    T_world_mine = np.eye(4)
    T_world_mine[:3, 3] = scene.offset_m
    return VolumeRecord(
        format=VOLUME_FORMAT,
        name=scene.name,
        frames=FRAMES,
        T_world_mine=T_world_mine.tolist(),
        tilt_deg=0.0,
        gain_m={
            "entrance_region": 0.0,
            "entrance_length": params.entrance_length_m,
            "whole_frame": round(figures.high_m - figures.low_m, 3),
        },
        world_m=scene.world_m,
        plan_frame=free_space.frame,
        areas=free_space.areas,
        zones=scene.zones,
        rock_friction=scene.rock_friction,
        lights=len(scene.lights),
        collision_parts=len(scene.parts),
        loops=legs.loops,
        drifts=len(legs.legs),
        spawn=start,
        look=scene.look,
        overlay=ROUGH_OVERLAY if scene.rock else NO_OVERLAY,
        geom_groups=GEOM_GROUPS,
        files={},
        world_sha256="",
        volume=figures,
    )
