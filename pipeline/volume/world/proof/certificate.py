"""The work of stage 6 for a world that is one volume: its figures, and the certificate of those with limits."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from minexplore.bundle import CELLS, MODEL, PARTS, RECORD, TOPOLOGY, VOLUME
from minexplore.floors.volume_arrays import FloorSpans, Parts, VolumeFacets
from pipeline.errors import ArtifactError
from pipeline.metrics.limits import flatten
from pipeline.params.validation import VolumeProofParams
from pipeline.proof.certificate import COMPARED_M, Certificate, certify
from pipeline.store.codecs import decode
from pipeline.store.files import adapter_of, describe_field
from pipeline.store.verify import verify_world
from pipeline.types import ClosedMesh, DrawnFloors, Mesh, SurveyedLegs, VolumeShape
from pipeline.volume.areas import solid_of_floors
from pipeline.volume.enclosure import describe_place, measure_enclosure
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.passages.arch import Arch, arched
from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Volume
from pipeline.volume.world.built_length import built_lengths_m
from pipeline.volume.world.compile import robot_size
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.proof.compiled import clearance_error, compare_model
from pipeline.volume.world.proof.drawn import measure_drawn
from pipeline.volume.world.proof.floor import floor_figures
from pipeline.volume.world.proof.fronts import fronts_of
from pipeline.volume.world.proof.physics import ROBOTS, RobotsAtRest, measure_standing
from pipeline.volume.world.proof.reached import MapReach, measure_drives, reach_of
from pipeline.volume.world.proof.region import Region, region_of
from pipeline.volume.world.proof.scan import RayDeviation, ScanDeviation, measure_rays, measure_scan
from pipeline.volume.world.proof.solid import measure_solid
from pipeline.volume.world.proof.surveyed.leg_widths import width_figures
from pipeline.volume.world.proof.surveyed.open_legs import open_figures
from pipeline.volume.world.proof.surveyed.walls import line_figures, wall_figures
from pipeline.volume.world.proof.throws import Throws, throw_balls, throw_robots
from pipeline.volume.world.record import VolumeRecord
from pipeline.volume.world.surface.proof import measure_rock, read_rock
from pipeline.volume.world.topology import LegNetwork, leg_network, mine_network

_MM = 1e3
_LEAST_M3 = 0.1  # of a space: no robot fits into a smaller one, and 7 km of real cave have a pocket of two litres
_PLACES = 5  # where bodies are thrown in a mine that is too large for one model: most of the time goes by parts


@dataclass(frozen=True)
class Validated:
    """The figures of a volume world by group, its certificate, and how far a scan's points and its rays are off."""

    metrics: dict[str, Any]
    certificate: Certificate
    scan: ScanDeviation | None = None
    rays: RayDeviation | None = None


@dataclass(frozen=True)
class VolumeBundle:
    """What a bundle says that the certificate measures."""

    record: VolumeRecord
    mine: VolumeFacets
    parts: Parts
    cells: FloorSpans
    legs: LegNetwork
    model: bytes
    rock: dict[str, Mesh] = dataclasses.field(default_factory=dict)


def read_volume_record(folder: Path) -> VolumeRecord:
    """Check that a bundle holds what a volume world may, and read its record.

    Raises ArtifactError if a file is missing, changed or not allowed, or the record is invalid; the message names it.
    """
    verify_world(folder)
    try:
        record: VolumeRecord = adapter_of(VolumeRecord).validate_json((folder / RECORD).read_bytes(), strict=True)
    except OSError as error:
        raise ArtifactError(f"{folder / RECORD}: cannot be read ({error.strerror})") from error
    except ValidationError as error:
        raise ArtifactError(f"{folder / RECORD}: no record of a volume world: {describe_field(error)}") from error
    return record


def open_volume(folder: Path) -> VolumeBundle:
    """Read the bundle of a volume world."""
    record = read_volume_record(folder)
    return VolumeBundle(
        record,
        decode(folder / VOLUME, VolumeFacets),
        decode(folder / PARTS, Parts),
        decode(folder / CELLS, FloorSpans),
        decode(folder / TOPOLOGY, LegNetwork),
        (folder / MODEL).read_bytes(),
        read_rock(folder, record.files),
    )


def seen_volume(params: VolumeProofParams, world: VolumeBundle) -> VolumeFacets:
    """Return the facets that the visible rock is moved from: those of the volume, under drawn roofs with an arch."""
    is_drawn = world.record.volume.is_drawn
    return arched(world.mine, Arch(params.arch_rise_m, params.arch_half_span_m)) if is_drawn else world.mine


def validate_volume(params: VolumeProofParams, world: VolumeBundle, shape: VolumeShape) -> Validated:
    """Measure a volume world against its survey: its legs, the solid where it is one, or drawn floors.

    Raises
    ------
    GeometryError
        If its mesh is not closed.
    """
    rng, volume = np.random.default_rng(params.seed), closed_volume(world.mine)
    fronts = fronts_of(volume, world.parts)
    compiled = compare_model(world.model, world.parts, world.record.zones, params.compiled, rng)
    solid = shape if isinstance(shape, ClosedMesh) else None
    scan = measure_scan(volume, solid.scan_m, rng) if solid is not None and len(solid.scan_m) else None
    rays = measure_rays(volume, world.rock, solid.rays_m) if solid is not None and len(solid.rays_m) else None
    reach = reach_of(world.cells, robot_size(params.volume), world.record.spawn.anchor_m)
    metrics = {
        "volume": {
            "facets": len(world.mine.faces),
            "parts": len(world.parts),
            "free_m3": round(float(volume.solid.volume()), 3),
            "storeys": world.record.volume.storeys,
        },
        **_against(params, shape, world, volume, rng),
        **{name: found.figures for name, found in (("scan", scan), ("rays", rays)) if found is not None},
        "enclosure": {
            **measure_enclosure(volume, fronts.parts, fronts.faces).figures,
            "compiled_mm": round(compiled.compiled_mm, 6),
            "unlike": compiled.unlike,
            "mislabelled": fronts.mislabelled,
        },
        "rock": measure_rock(closed_volume(seen_volume(params, world)), world.legs, world.rock, rng),
        "reach": reach.figures,
        **_bodies(params, volume, fronts.parts, rng),
        **_drives(params, world, fronts.parts, reach),
    }
    figures = flatten(metrics)
    certificate = certify(world.record.world_sha256, figures, params.applying(metrics))
    certificate = dataclasses.replace(certificate, contacts=int(figures.get("robots.contacts", 0)))
    return Validated(metrics | {"certificate": {"holds": int(certificate.holds)}}, certificate, scan, rays)


def _against(
    params: VolumeProofParams, shape: VolumeShape, world: VolumeBundle, volume: Volume, rng: np.random.Generator
) -> dict[str, Any]:
    """Return how the volume follows what it was made of, by group."""
    match shape:
        case SurveyedLegs():
            network, offset = mine_network(shape, params.height_m, params.volume)
            return {
                "survey": _survey(network, offset, shape, world, volume),
                "floor": floor_figures(network, offset, world.mine),
                "walls": wall_figures(shape, volume),
            }
        case ClosedMesh():
            return {"solid": measure_solid(volume, shape, rng)}
    solid = solid_of_floors(shape, params.height_m, params.volume.half_width_m)
    return {"drawn": _drawn(params, volume, shape), "solid": measure_solid(volume, solid, rng)}


def _drawn(params: VolumeProofParams, volume: Volume, floors: DrawnFloors) -> dict[str, Any]:
    """Return how the floors follow the drawn ones."""
    found = measure_drawn(volume, floors, params.volume.half_width_m)
    return {
        "floor_mm": round(_MM * found.error_m, 6),
        "median_mm": round(_MM * found.median_m, 6),
        "step_mm": round(_MM * found.step_m, 6),
    }


def _survey(
    network: SurveyNetwork, offset: np.ndarray, surveyed: SurveyedLegs, world: VolumeBundle, volume: Volume
) -> dict[str, Any]:
    """Return how much of the survey is built: of the file's legs, not of those that the bundle says it has."""
    piece_m = float(network.lengths_m.sum())
    wanted = leg_network(network, offset, surveyed)
    built = built_lengths_m(volume, wanted)
    missing = np.array([leg.length_m for leg in wanted.legs]) - built
    return {
        "surveyed_m": round(surveyed.surveyed_m, 3),
        "length_m": round(piece_m, 3),
        "built_m": round(float(built.sum()), 3),
        "share_built": round(float(built.sum()) / piece_m, 6),
        "unbuilt_m": round(float(missing.max()), 3),
        "unbuilt_at": f"leg {network.leg_name(int(missing.argmax()))}",
        "pieces": 1 + len(surveyed.pieces_m),
        "legs": len(world.legs.legs),
        "spaces": _spaces(volume),
        "entrances": len(world.record.volume.entrances),
        "closed_ends": len(world.record.volume.closed_ends),
        **open_figures(network, offset, volume),
        **width_figures(network, offset, world.mine),
        **line_figures(network, offset, volume),
    }


def _spaces(volume: Volume) -> int:
    """Return of how many spaces that do not meet a volume is: closed surfaces about free space, not about rock."""
    return sum(space.volume() > _LEAST_M3 for space in volume.solid.decompose())


def _bodies(
    params: VolumeProofParams, volume: Volume, parts: list[ShellPart], rng: np.random.Generator
) -> dict[str, Any]:
    """Return robots at rest about one place, robots that are thrown, and balls about some places, as far as asked for.

    Where a mine has more parts than one model may, they are shared out among the places. Robots rest at the first of
    these places where the floor is even. They are thrown all over the mine.
    """
    found: dict[str, Any] = {}
    count = _PLACES if len(parts) > params.most_parts else 1
    for _ in range(count):
        region = region_of(volume, parts, params.most_parts, rng)
        if not params.robot_contacts:
            break
        at_rest = measure_standing(volume, region.parts, rng, region.targets)
        found["standing"] = _standing(at_rest)
        if at_rest.rest_at is not None:
            break
    places = [region_of(volume, parts, params.most_parts // count, rng) for _ in range(count)]
    found["clearance"] = _clearance(params, volume, places)
    if params.robot_contacts:
        found["robots"] = _robots(throw_robots(volume, parts, params.robot_contacts, rng), params.robot_contacts)
    if params.ball_contacts:
        asked = -(-params.ball_contacts // count)
        thrown = (throw_balls(volume, one.parts, asked, False, rng, targets=one.targets) for one in places)
        found["balls"] = _thrown(sum(thrown, Throws()))
    return found


def _standing(found: RobotsAtRest) -> dict[str, Any]:
    """Return the figures of robots at rest, and which moved farthest and where it stood, in the mine frame."""
    figures: dict[str, Any] = {"rest_mm": round(_MM * found.rest_m, 6), "climb_share": round(found.climb_share, 6)}
    if found.rest_at is None:
        return figures
    number, place = found.rest_at
    return figures | {"rest_at": f"robot {number + 1} of {ROBOTS} at {describe_place(np.array(place))}"}


def _drives(params: VolumeProofParams, world: VolumeBundle, parts: list[ShellPart], reach: MapReach) -> dict[str, Any]:
    """Return the robots that drive where the map says they can, if robots are asked for."""
    if not params.robot_contacts:
        return {}
    found = measure_drives(world.mine, parts, world.cells, reach, np.random.default_rng(params.seed))
    return {"drives": {"ways": found.ways, "share": round(found.arrived / found.ways, 6) if found.ways else 1.0}}


def _clearance(params: VolumeProofParams, volume: Volume, places: list[Region]) -> dict[str, Any]:
    """Return the largest difference of MuJoCo's distances to rock from those to the surface, and where it is."""
    rng, most_m = np.random.default_rng(params.seed), params.volume.robot_radius_m + COMPARED_M
    errors = [clearance_error(volume, one.parts, one.targets, most_m, rng) for one in places]
    worst = max(errors, key=lambda error: error.error_m)
    at = {} if worst.place_m is None else {"error_at": describe_place(worst.place_m)}
    return {"places": sum(error.places for error in errors), "error_m": round(worst.error_m, 5)} | at


def _robots(found: Throws, asked: int) -> dict[str, Any]:
    """Return the figures of thrown robots; where none fits before a wall, no contact that was asked for is missing."""
    share = min(1.0, found.contacts / asked) if found.throws else 1.0
    figures = _thrown(found) | {"contacts_share": round(share, 6), "deepest_m": round(found.deepest_m, 5)}
    if found.deepest_m > 0 and found.deepest_at is not None:
        figures["deepest_at"] = describe_place(np.array(found.deepest_at))
    return figures


def _thrown(found: Throws) -> dict[str, Any]:
    return {"contacts": found.contacts, "throws": found.throws, "escapes": found.escapes}
