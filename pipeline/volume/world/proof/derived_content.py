"""Make again what a volume's bundle states beside its mesh and parts: cells, maps, octree, legs, figures, start."""

from __future__ import annotations

import dataclasses
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from minexplore.bundle import CELLS, OCTREE, RECORD, STOREY_MAPS, TOPOLOGY, VOLUME, storey_map
from pipeline.errors import ArtifactError, GeometryError
from pipeline.params.compile3d import SpawnParams
from pipeline.params.fittings import FloorParams
from pipeline.params.validation import VolumeProofParams
from pipeline.proof.rebuilt.differences import first_difference
from pipeline.proof.rebuilt.fittings import require_floor
from pipeline.proof.rebuilt.shading import JoinedRock, require_shading
from pipeline.store.codecs import decode
from pipeline.types import DrawnFloors, Image, Mesh, SurveyedLegs, VolumeShape
from pipeline.volume.world.built_length import built_length_m
from pipeline.volume.world.cells import cells_of
from pipeline.volume.world.compile import robot_size
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.floor.cover import lay_floor
from pipeline.volume.world.maps import drawn_maps, octree_of
from pipeline.volume.world.proof.again.labelled import require_labelled
from pipeline.volume.world.proof.again.remodelled import require_same_model
from pipeline.volume.world.proof.again.seen import require_plan
from pipeline.volume.world.proof.again.textured import require_textured
from pipeline.volume.world.proof.certificate import VolumeBundle
from pipeline.volume.world.record import OpenEnd
from pipeline.volume.world.solid import legs_on_floors
from pipeline.volume.world.topology import LegNetwork, leg_network, mine_network, start_of

_ROUND_M = 2e-6  # spans have six decimals
_CLEARANCE_M = 1e-4  # distances have 32 bits
_LEG_M = 1e-3  # legs have four decimals, lengths of the record three
_ROUND_START_M = 1.1e-4  # places have four decimals
_OF_FLOOR = re.compile(r"\d+\.\d+\..+")  # a station of a leg along a floor
_WITHIN_M = {"floor_m": _ROUND_M, "headroom_m": _ROUND_M, "origin_m": _ROUND_M, "clearance_m": _CLEARANCE_M} | {
    "aside_m": _CLEARANCE_M,
    "way_m": _CLEARANCE_M,
}


def require_remade(
    folder: Path,
    world: VolumeBundle,
    params: VolumeProofParams,
    surveyed: SurveyedLegs | None,
    shape: VolumeShape | None = None,
    floor: FloorParams | None = None,
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
    shape : VolumeShape, optional
        What was surveyed, if it is known: it has the elevation of z = 0, and is drawn areas or not.
    floor : FloorParams, optional
        What the visible floor was made with, if there is one.

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
    require_labelled(folder, world, surveyed is None, params)
    _require_figures(folder, world, surveyed, shape)
    require_plan(folder, world, surveyed)
    _require_start(folder, world, params)
    require_floor(folder, world.record.files, floor, lambda wanted: _laid(world, wanted))
    require_same_model(folder, world, floor.water_m if floor else 0.0)
    if world.rock:
        require_shading(folder, world.rock, JoinedRock.of(list(world.rock.values())))
        require_textured(folder, world.rock)


def _laid(world: VolumeBundle, params: FloorParams) -> dict[str, Mesh]:
    return lay_floor(params, world.mine, world.legs, world.record.zones)


def follows_floors(world: VolumeBundle, params: VolumeProofParams) -> bool:
    """Return whether a world's legs are those along the middles of its floors, as of a solid or of drawn areas."""
    if not all(_OF_FLOOR.fullmatch(name) for name in world.legs.stations_m):
        return False  # to make legs along floors takes seconds
    return _difference(world.legs, _network_of(_along_floors(world, params), params)) is None


def _difference(found: LegNetwork, wanted: LegNetwork) -> str | None:
    """Return the first difference of two networks; a grade may differ by as much as rounded places make of it."""
    one, two = (
        dataclasses.asdict(_in_order(replace(network, legs=[replace(leg, grade=0.0) for leg in network.legs])))
        for network in (found, wanted)
    )
    differs = first_difference(one, two, _LEG_M)
    for number, (leg, other) in enumerate(zip(found.legs, wanted.legs, strict=True)) if differs is None else ():
        run_m = max(other.length_m / math.hypot(1, other.grade), _LEG_M)
        differs = differs or first_difference(
            leg.grade, other.grade, _LEG_M * (1 + other.grade) / min(run_m, 1), f"legs[{number}].grade"
        )
    return differs


def _in_order(network: LegNetwork) -> LegNetwork:
    """Return a network with its lists of stations sorted: their order is that of a file, which not everybody has."""
    junctions, dead_ends, entrances = map(sorted, (network.junctions, network.dead_ends, network.entrances))
    return replace(network, junctions=junctions, dead_ends=dead_ends, entrances=entrances)


def _network_of(surveyed: SurveyedLegs, params: VolumeProofParams) -> LegNetwork:
    network, offset = mine_network(surveyed, params.height_m, params.volume)
    return leg_network(network, offset, surveyed)


def _along_floors(world: VolumeBundle, params: VolumeProofParams) -> SurveyedLegs:
    return legs_on_floors(world.cells, robot_size(params.volume), world.record.volume.datum_m)


def _require_cells(folder: Path, world: VolumeBundle, params: VolumeProofParams) -> None:
    made, stated = cells_of(world.mine, world.cells.cell_m, robot_size(params.volume)), world.cells
    for name in (field.name for field in dataclasses.fields(made)):
        found, wanted = getattr(stated, name), getattr(made, name)
        if np.shape(found) != np.shape(wanted):
            raise ArtifactError(f"{folder / CELLS}: {len(found)} spans, want {len(wanted)}, as {VOLUME} has")
        wrong = np.argwhere(np.abs(np.subtract(found, wanted)) > _WITHIN_M.get(name, 0))
        if len(wrong):
            k = tuple(wrong[0].tolist())
            raise ArtifactError(
                f"{folder / CELLS}: {name}{list(k)} = {found[k]}, want {wanted[k]}, by {VOLUME} and the robot of "
                f"compile3d.volume; {len(wrong)} of {np.size(wanted)} differ"
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


def _require_figures(
    folder: Path, world: VolumeBundle, surveyed: SurveyedLegs | None, shape: VolumeShape | None
) -> None:
    """Compare the figures of the record that follow from the legs and the free space.

    Legs along floors are all that was surveyed. Who has no survey, and so no datum, does not know how much more was
    surveyed than was built.
    """
    record, legs = world.record, world.legs
    stated, built = record.volume, built_length_m(closed_volume(world.mine), legs)
    known_m = legs.total_length_m if surveyed is None else surveyed.surveyed_m
    surveyed_m = stated.surveyed_m if surveyed is not None and shape is None else known_m
    closed = [name for name in legs.dead_ends if name not in legs.entrances]
    wanted = {
        "loops": legs.loops,
        "drifts": len(legs.legs),
        "entrances": [dataclasses.asdict(OpenEnd(name, legs.stations_m[name])) for name in legs.entrances],
        "closed_ends": [dataclasses.asdict(OpenEnd(name, legs.stations_m[name])) for name in closed],
        "piece_m": min(legs.total_length_m, stated.surveyed_m),
        "built_m": min(built, legs.total_length_m, stated.surveyed_m),
        "datum_m": stated.datum_m if shape is None else shape.datum_m,
        "is_drawn": stated.is_drawn and surveyed is None if shape is None else isinstance(shape, DrawnFloors),
        "surveyed_m": surveyed_m,
    }
    found = {**dataclasses.asdict(stated), "loops": record.loops, "drifts": record.drifts}
    differs = first_difference({name: found[name] for name in wanted}, wanted, _LEG_M)
    if differs:
        raise ArtifactError(f"{folder / RECORD}: {differs}, as {TOPOLOGY} has")


def _require_start(folder: Path, world: VolumeBundle, params: VolumeProofParams) -> None:
    """Choose again where robots start, for the radius and the clearance that are stated, and compare.

    The start is that of the legs, or that of a place which somebody stated, of which the record has the middle.
    """
    start, cells, robot = world.record.spawn, world.cells, robot_size(params.volume)
    spawn = SpawnParams(radius_m=start.radius_m, clearance_m=start.clearance_m)
    differs = ""
    for place in (None, start.centre_m[:2], start.centre_m):
        try:
            made = start_of(cells, world.legs, place, spawn, robot)
        except GeometryError as error:
            differs = differs or str(error)
            continue
        found = first_difference(dataclasses.asdict(start), dataclasses.asdict(made), _ROUND_START_M, "spawn")
        if found is None:
            return
        differs = differs or f"{found}, as robots start by {CELLS} and {TOPOLOGY}"
    raise ArtifactError(f"{folder / RECORD}: {differs}")
