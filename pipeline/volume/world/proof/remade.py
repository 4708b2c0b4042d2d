"""Make again what a volume's bundle states beside its mesh and parts: cells, maps, octree, legs, figures, start."""

from __future__ import annotations

import dataclasses
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from minexplore.bundle import CELLS, OCTREE, PARTS, RECORD, STOREY_MAPS, TOPOLOGY, VOLUME, storey_map
from minexplore.floors.volume_arrays import FacetLabel, FloorSpans
from pipeline.errors import ArtifactError
from pipeline.params.validation import VolumeProofParams
from pipeline.proof.rebuilt.differences import first_difference
from pipeline.store.codecs import decode
from pipeline.types import Image, SurveyedLegs, lines_of
from pipeline.volume.world.built import built_length_m
from pipeline.volume.world.cells import cells_of
from pipeline.volume.world.compile import robot_size
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.maps import drawn_maps, octree_of
from pipeline.volume.world.parts import TWINS_M, twin_corners
from pipeline.volume.world.proof.certificate import VolumeBundle
from pipeline.volume.world.reach import neighbours_of
from pipeline.volume.world.record import OpenEnd, VolumeRecord
from pipeline.volume.world.solid import labels_of, legs_on_floors, nearest_leg
from pipeline.volume.world.topology import LegNetwork, leg_network, mine_network

_ROUND_M = 2e-6  # spans have six decimals
_CLEARANCE_M = 1e-4  # distances have 32 bits
_LEG_M = 1e-3  # legs have four decimals, lengths of the record three
_ON_BORDER_M = 1e-3  # of zones: parts are cut to 0.1 mm
_BESIDE_M = 2.0  # that a facet is beyond its leg's sections: floors that legs share reach as far
_ON_SPAN_M = 1e-3  # of where robots start from the middle of a span
_ASTRAY = 0.01  # share of the surface likewise: facets of several legs that lie in one plane become one of them
_SLIVERS = 2e-5  # share of the surface whose facets may be turned over, as thin ones are when a mesh is simplified
_OF_FLOOR = re.compile(r"\d+\.\d+\..+")  # a station of a leg along a floor
_WITHIN_M = {"floor_m": _ROUND_M, "headroom_m": _ROUND_M, "origin_m": _ROUND_M, "clearance_m": _CLEARANCE_M}


def require_remade(
    folder: Path,
    world: VolumeBundle,
    params: VolumeProofParams,
    surveyed: SurveyedLegs | None,
    datum_m: float | None = None,
) -> None:
    """Make the files and figures of a volume's bundle again from its mesh and its survey, and compare them.

    Parameters
    ----------
    folder : Path
        A bundle that `open_volume` has checked.
    world : VolumeBundle
    params : VolumeProofParams
        The heights and the robot of `compile3d` that the world was made with.
    surveyed : SurveyedLegs or None
        The legs of the survey, or those that the bundle states; None if the world's legs follow its floors.
    datum_m : float, optional
        The elevation of z = 0, if the survey is known.

    Raises
    ------
    ArtifactError
        If something differs. The message names the file, the first value that differs, and the right one.
    """
    _require_cells(folder, world, params)
    _require_maps(folder, world)
    legs = _along_floors(world, params) if surveyed is None else surveyed
    differs = _difference(world.legs, _network_of(legs, params))
    if differs:
        raise ArtifactError(
            f"{folder / TOPOLOGY}: {differs}, as the {'floors have' if surveyed is None else 'legs have'}"
        )
    _require_facets(folder, world, legs if surveyed is None else None, params)
    _require_parts(folder, world)
    _require_figures(folder, world, datum_m)
    _require_start(folder, world.record, world.cells)


def follows_floors(world: VolumeBundle, params: VolumeProofParams) -> bool:
    """Return whether a world's legs are those along the middles of its floors, as of a solid or of drawn areas."""
    if not all(_OF_FLOOR.fullmatch(name) for name in world.legs.stations_m):
        return False  # to make legs along floors takes seconds
    return _difference(world.legs, _network_of(_along_floors(world, params), params)) is None


def _difference(found: LegNetwork, wanted: LegNetwork) -> str | None:
    """Return the first difference of two networks; a grade may differ by as much as rounded places make of it."""
    one, two = (
        dataclasses.asdict(replace(network, legs=[replace(leg, grade=0.0) for leg in network.legs]))
        for network in (found, wanted)
    )
    differs = first_difference(one, two, _LEG_M)
    for number, (leg, other) in enumerate(zip(found.legs, wanted.legs, strict=True)) if differs is None else ():
        run_m = max(other.length_m / math.hypot(1, other.grade), _LEG_M)
        differs = differs or first_difference(
            leg.grade, other.grade, _LEG_M * (1 + other.grade) / min(run_m, 1), f"legs[{number}].grade"
        )
    return differs


def _network_of(surveyed: SurveyedLegs, params: VolumeProofParams) -> LegNetwork:
    network, offset = mine_network(surveyed, params.height_m, params.volume)
    return leg_network(network, offset, lines_of(surveyed.entrances))


def _along_floors(world: VolumeBundle, params: VolumeProofParams) -> SurveyedLegs:
    pairs = neighbours_of(world.cells, robot_size(params.volume))
    return legs_on_floors(world.cells, pairs, world.record.volume.datum_m)


def _require_facets(
    folder: Path, world: VolumeBundle, along_floors: SurveyedLegs | None, params: VolumeProofParams
) -> None:
    """Compare labels and legs of facets with those that facets of a solid have.

    Of surveyed legs, floors may be steeper than robots drive, walls may lean, and legs that meet share floors: floors
    must face down, roofs up, and nearly all facets be about their legs.
    """
    mine, up = world.mine, world.mine.normals[:, 2]
    if along_floors is None:
        turned = (mine.label == FacetLabel.FLOOR) & (up >= 0) | (mine.label == FacetLabel.ROOF) & (up <= 0)
        found = ("label", turned, _SLIVERS), ("leg", _beyond_legs_m(world) > _BESIDE_M, _ASTRAY)
    else:
        labels = labels_of(mine.vertices, mine.faces, params.volume.steepest)
        legs = nearest_leg(closed_volume(mine), along_floors)
        found = ("label", mine.label != labels, _SLIVERS), ("leg", mine.leg != legs, _SLIVERS)
    area = np.linalg.norm(mine.normals, axis=1)
    for name, wrong, most in found:
        if area[wrong].sum() > most * area.sum():
            k = int(np.where(wrong, area, 0).argmax())
            raise ArtifactError(
                f"{folder / VOLUME}: {name}[{k}] = {getattr(mine, name)[k]}: no facet of this slope and place has it; "
                f"{int(wrong.sum())} of {len(wrong)} are wrong"
            )


def _beyond_legs_m(world: VolumeBundle) -> np.ndarray:
    """Return how much farther (f,) m the nearest corner of each facet is from its leg than the leg's sections reach."""
    mine, legs = world.mine, world.legs
    ends = [np.array([legs.stations_m[getattr(leg, end)] for leg in legs.legs])[mine.leg] for end in ("start", "end")]
    reach = np.array([np.abs(leg.lrud_m).max() for leg in legs.legs])[mine.leg]
    way, apart = (ends[1] - ends[0])[:, None], mine.vertices[mine.faces] - ends[0][:, None]
    share = np.clip((apart * way).sum(axis=2) / np.maximum((way * way).sum(axis=2), _LEG_M**2), 0, 1)
    found: np.ndarray = np.linalg.norm(apart - share[:, :, None] * way, axis=2).min(axis=1) - reach
    return found


def _require_parts(folder: Path, world: VolumeBundle) -> None:
    """Refuse a part with twin corners, of which MuJoCo may miss contacts, and one of the floor in two zones."""
    twins = twin_corners(world.parts)
    if len(twins):
        number = int(np.searchsorted(world.parts.first, twins[0], side="right")) - 1
        raise ArtifactError(
            f"{folder / PARTS}: part {number} has two corners within {TWINS_M:g} m, at which MuJoCo may miss contacts"
        )
    (low, high), floor = world.parts.boxes_m, world.parts.label == FacetLabel.FLOOR
    for zone in world.record.zones[:-1]:
        across = floor & (low[:, 0] < zone.east_m - _ON_BORDER_M) & (high[:, 0] > zone.east_m + _ON_BORDER_M)
        if across.any():
            raise ArtifactError(
                f"{folder / PARTS}: part {int(across.argmax())} is in two zones of the floor, which meet at x = "
                f"{zone.east_m:g} m"
            )


def _require_cells(folder: Path, world: VolumeBundle, params: VolumeProofParams) -> None:
    made, stated = cells_of(world.mine, world.cells.cell_m, robot_size(params.volume)), world.cells
    for name in (field.name for field in dataclasses.fields(made)):
        found, wanted = getattr(stated, name), getattr(made, name)
        if np.shape(found) != np.shape(wanted):
            raise ArtifactError(f"{folder / CELLS}: {len(found)} spans, want {len(wanted)}, as {VOLUME} has")
        wrong = np.flatnonzero(np.abs(np.subtract(found, wanted)) > _WITHIN_M.get(name, 0))
        if len(wrong):
            k = wrong[0]
            raise ArtifactError(
                f"{folder / CELLS}: {name}[{k}] = {found[k]}, want {wanted[k]}, by {VOLUME} and the robot of "
                f"compile3d.volume; {len(wrong)} of {len(wanted)} differ"
            )


def _require_maps(folder: Path, world: VolumeBundle) -> None:
    """Compare the octree, the texts of the maps, and the pixels of their pictures."""
    if (folder / OCTREE).read_bytes() != octree_of(world.cells):
        raise ArtifactError(f"{folder / OCTREE}: not the octree of {CELLS}")
    missing = {name for name in world.record.files if re.fullmatch(STOREY_MAPS, name)}
    for storey, text, pixels in drawn_maps(world.cells):
        for name in storey_map(storey):
            if name not in missing:
                raise ArtifactError(f"{folder / name}: missing; {CELLS} has a storey {storey}")
            missing.remove(name)
        yaml, picture = (folder / name for name in storey_map(storey))
        found = decode(picture, Image)
        for path, same in ((yaml, yaml.read_bytes() == text), (picture, np.array_equal(found, pixels))):
            if not same:
                raise ArtifactError(f"{path}: not the map of storey {storey} of {CELLS}")
    if missing:
        raise ArtifactError(f"{folder / min(missing)}: a map of a storey that {CELLS} has not")


def _require_figures(folder: Path, world: VolumeBundle, datum_m: float | None) -> None:
    """Compare the figures of the record that follow from the legs and the free space."""
    record, legs = world.record, world.legs
    stated, built = record.volume, built_length_m(closed_volume(world.mine), legs)
    closed = [name for name in legs.dead_ends if name not in legs.entrances]
    wanted = {
        "loops": legs.loops,
        "drifts": len(legs.legs),
        "entrances": [dataclasses.asdict(OpenEnd(name, legs.stations_m[name])) for name in legs.entrances],
        "closed_ends": [dataclasses.asdict(OpenEnd(name, legs.stations_m[name])) for name in closed],
        "piece_m": min(legs.total_length_m, stated.surveyed_m),
        "built_m": min(built, legs.total_length_m, stated.surveyed_m),
        "datum_m": stated.datum_m if datum_m is None else datum_m,
    }
    found = {**dataclasses.asdict(stated), "loops": record.loops, "drifts": record.drifts}
    differs = first_difference({name: found[name] for name in wanted}, wanted, _LEG_M)
    if differs:
        raise ArtifactError(f"{folder / RECORD}: {differs}, as {TOPOLOGY} has")


def _require_start(folder: Path, record: VolumeRecord, cells: FloorSpans) -> None:
    """Refuse a start that is on no floor for robots, has another clearance than its span."""
    start = record.spawn
    apart = np.linalg.norm(cells.places_m - start.anchor_m, axis=1)
    k = int(apart.argmin())
    clearance_m = float(cells.clearance_m[k])
    on_floor = apart[k] < _ON_SPAN_M and cells.storey[k] >= 0
    if not on_floor or not start.clearance_m - _CLEARANCE_M <= clearance_m:
        raise ArtifactError(
            f"{folder / RECORD}: spawn.anchor_m = {list(start.anchor_m)}: want the middle of a floor of {CELLS}, "
            f"{start.clearance_m:g} m from rock"
        )
    if abs(start.anchor_clearance_m - clearance_m) > _ON_SPAN_M:
        raise ArtifactError(
            f"{folder / RECORD}: spawn.anchor_clearance_m = {start.anchor_clearance_m}, want {clearance_m:.4f}"
        )
