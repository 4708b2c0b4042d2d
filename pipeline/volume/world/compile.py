"""The work of stage 3 for a survey that is built as one volume: mesh, parts, cells, maps and where robots start."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from minesurveys.errors import first_few
from minesurveys.remarks import warn_user
from minexplore.bundle import CELLS, OCTREE, PARTS, TOPOLOGY, VOLUME
from minexplore.floors.volume_arrays import FloorSpans, VolumeFacets
from pipeline.errors import GeometryError, MineError
from pipeline.params.compile3d import Compile3dParams, VolumeParams
from pipeline.places import SPAWN
from pipeline.progress import progress
from pipeline.scans.meshes.uncrossed import uncrossed
from pipeline.store.codecs import Bundle, encode
from pipeline.types import ClosedMesh, SurveyedLegs, VolumeShape, lines_of
from pipeline.volume.areas import solid_of_floors
from pipeline.volume.floors import solve_floors
from pipeline.volume.height_field.assumed_roofs import ROCK_M
from pipeline.volume.labelled_solid import with_short_edges
from pipeline.volume.merged import merge_parts
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.rock.parted import parted
from pipeline.volume.rock.polygons import LONGEST_M
from pipeline.volume.shell import build_shell
from pipeline.volume.thin_rock import NARROW_M, without_thin_rock
from pipeline.volume.union import Volume
from pipeline.volume.world.built_length import built_length_m
from pipeline.volume.world.cells import cells_of
from pipeline.volume.world.content import closed_volume, in_mine_frame, with_settled_labels
from pipeline.volume.world.maps import octree_of, storey_maps
from pipeline.volume.world.parts import labelled_parts, without_refused
from pipeline.volume.world.reach import RobotSize
from pipeline.volume.world.record import BuiltVolume, OpenEnd
from pipeline.volume.world.solid import labels_of, legs_on_floors, mine_volume, nearest_leg, volume_of_solid
from pipeline.volume.world.topology import LegNetwork, leg_network, mine_network, require_flat_leg, start_of

BUILT = "built.json"  # with `spawn.json` of the stage's folder; a bundle has both in `world.json`
_FLOATING_M3 = 1e-3  # of rock in the free space of a solid: a smaller piece is no piece of a file
_THICKENINGS = 3  # rock put before much thin rock may cross other rock; what is found again may be thin


def robot_size(params: VolumeParams) -> RobotSize:
    """Return the robot that storeys and reach are of."""
    return RobotSize(params.steepest, params.step_m, params.robot_height_m, params.robot_radius_m)


def compile_volume(
    params: Compile3dParams,
    shape: VolumeShape,
    start_m: list[float] | None = None,
    subject: str = "survey",
) -> Bundle:
    """Return the files of a volume by name: what the bundle copies, `spawn.json` and `built.json`.

    The volume is the union of surveyed legs, or a solid, or the space over drawn floors with their shafts; of the last
    two the legs follow the middles of its floors. Robots start at `start_m`, (x, y[, z]) m, mine frame, or where
    `start_of` chooses.

    Raises
    ------
    GeometryError
        If the legs make no closed volume, or robots find no room. The message names `subject`, the survey's file.
    """
    try:
        with progress("compile3d", 3, "steps") as done:
            made = _made_of(params, shape)
            done.update()
            return _files_of(params, made, start_m, done.update)
    except (ValueError, MineError) as error:
        raise GeometryError(f"{subject}: {error}") from error


def _made_of(params: Compile3dParams, shape: VolumeShape) -> _VolumeDraft:
    match shape:
        case SurveyedLegs():
            return _of_legs(params, shape)
        case ClosedMesh():
            return _of_solid(params, shape, _FLOATING_M3)
    drawn = solid_of_floors(shape, params.height_m, params.volume.half_width_m)
    return replace(_of_solid(params, drawn, np.inf), is_drawn=True)


def _files_of(
    params: Compile3dParams, made: _VolumeDraft, start_m: list[float] | None, done: Callable[[], Any]
) -> Bundle:
    """Return the files of a volume; calls `done` after each of two steps."""
    volume, cells, surveyed, legs = made.volume, made.cells, made.surveyed, made.legs
    robot = robot_size(params.volume)
    parts, refused = without_refused(merge_parts(made.solved, build_shell(made.solved)))
    done()
    start = start_of(cells, legs, start_m, params.spawn, robot, surveyed.datum_m)
    built = _built(surveyed, legs, built_length_m(closed_volume(volume), legs), refused, made.is_drawn)
    if not made.is_solid:
        _warn(built)
    done()
    return {
        VOLUME: encode(Path(VOLUME), volume),
        PARTS: encode(Path(PARTS), labelled_parts(parts, volume, made.offset_m)),
        CELLS: encode(Path(CELLS), cells),
        TOPOLOGY: encode(Path(TOPOLOGY), legs),
        OCTREE: octree_of(cells),
        SPAWN: encode(Path(SPAWN), start),
        BUILT: encode(Path(BUILT), built),
        **storey_maps(cells),
    }


@dataclass(frozen=True)
class _VolumeDraft:
    """A volume about its own middle and in the mine frame, its cells, and its legs."""

    solved: Volume
    volume: VolumeFacets
    offset_m: np.ndarray
    cells: FloorSpans
    surveyed: SurveyedLegs
    legs: LegNetwork
    is_solid: bool
    is_drawn: bool = False


def _of_legs(params: Compile3dParams, surveyed: SurveyedLegs) -> _VolumeDraft:
    network, offset = mine_network(surveyed, params.height_m, params.volume)
    if network.repairs:
        warn_user(f"repaired are {first_few(network.repairs, '; ')}", of="compile3d")
    _warn_of_lowered(network)
    require_flat_leg(network)
    solved = solve_floors(network)
    legs = leg_network(network, offset, surveyed)
    volume = with_settled_labels(in_mine_frame(solved, offset), legs)
    solved = replace(solved, label=volume.label.astype(solved.label.dtype))
    cells = cells_of(volume, params.grid_cell_m, robot_size(params.volume))
    return _VolumeDraft(solved, volume, offset, cells, surveyed, legs, False)


def _warn_of_lowered(network: SurveyNetwork) -> None:
    """Print how many stations have an assumed roof that is lower than others, as a floor passes over it."""
    lowered = network.roof_lowered
    if lowered.any():
        tall = np.where(lowered, network.lrud_m[:, :, 2:].sum(axis=2), np.inf)
        leg, end = np.unravel_index(tall.argmin(), tall.shape)
        warn_user(
            "stations without a measured roof have a lower one, as floors pass over them: "
            f"{tall[leg, end]:.2f} m over the floor at {network.names[network.shots[leg, end]]}, with "
            f"{ROCK_M:g} m of rock over it",
            of="compile3d",
            count=len(np.unique(network.shots[lowered])),
        )


def _of_solid(params: Compile3dParams, solid: ClosedMesh, floating_m3: float) -> _VolumeDraft:
    robot = robot_size(params.volume)
    solved = volume_of_solid(solid, robot.steepest)
    for _ in range(_THICKENINGS):
        solved = without_thin_rock(solved, np.zeros((0, 3)), floating_m3, NARROW_M)
        apart = uncrossed(solved.vertices, solved.faces)
        if not apart.crossed:
            break
        solid = replace(solid, vertices=apart.vertices, faces=apart.faces.astype(np.int32))
        solved = volume_of_solid(solid, robot.steepest)
    vertices = parted(solved.vertices, solved.faces)
    solved = replace(solved, vertices=vertices, label=labels_of(vertices, solved.faces, robot.steepest))
    solved = with_short_edges(solved, LONGEST_M)
    bare = mine_volume(solved, solved.source)
    cells = cells_of(bare, params.grid_cell_m, robot)
    surveyed = legs_on_floors(cells, robot, solid.datum_m)
    network, offset = mine_network(surveyed, params.height_m, params.volume)
    network = replace(network, places_m=network.places_m + offset)
    volume = mine_volume(solved, nearest_leg(solved, network))
    surveyed = replace(surveyed, surveyed_m=float(network.lengths_m.sum()))
    legs = leg_network(network, np.zeros(3), surveyed)
    return _VolumeDraft(solved, volume, np.zeros(3), cells, surveyed, legs, True)


def _built(surveyed: SurveyedLegs, legs: LegNetwork, built_m: float, refused: int, is_drawn: bool) -> BuiltVolume:
    ends = [name for name in legs.dead_ends if name not in legs.entrances]
    surveyed_m = round(surveyed.surveyed_m, 3)
    piece_m = min(round(legs.total_length_m, 3), surveyed_m)  # lengths of legs are rounded one by one
    return BuiltVolume(
        surveyed_m,
        piece_m,
        min(round(built_m, 3), piece_m),
        surveyed.datum_m,
        [OpenEnd(name, legs.stations_m[name]) for name in legs.entrances],
        [OpenEnd(name, legs.stations_m[name]) for name in ends],
        list(zip(lines_of(surveyed.pieces), surveyed.pieces_m.round(3).tolist(), strict=True)),
        refused,
        is_drawn,
    )


def _warn(built: BuiltVolume) -> None:
    """Print what of the survey is built, and where the volume is closed."""
    share = 100 * built.built_m / max(built.piece_m, 1e-9)
    warn_user(
        f"built as one volume are {built.built_m:.0f} m of {built.surveyed_m:.0f} m surveyed, "
        f"{share:.1f} % of this piece of {built.piece_m:.0f} m",
        of="compile3d",
    )
    for what, ends in (("entrances are", built.entrances), ("ends of the survey are", built.closed_ends)):
        if ends:
            named = first_few([end.station for end in ends])
            warn_user(f"{what} closed by rock: {named}", of="compile3d", count=len(ends))
