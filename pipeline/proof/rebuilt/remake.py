"""Make again what a bundle states and compare it: plan figures, network, grid, map, octree, spawn.

Only the outline of the workings, the collision parts, the rough rock and the texture are taken from the bundle. The
outline is compared with the collision parts by the certificate, the rough rock with the outline by `visible`.
"""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import shapely
from pydantic import TypeAdapter
from shapely import Polygon

from minexplore.bundle import (
    CLEARANCE_GRID,
    FREE_SPACE,
    NAV2_MAP,
    OCTREE,
    RECORD,
    TOPOLOGY,
)
from pipeline.errors import ArtifactError, GeometryError
from pipeline.geometry.maps.occupancy import entrance_anchor, nav2_map, occupancy_grid
from pipeline.geometry.maps.octree import Columns, build_octree, to_bt
from pipeline.geometry.network.skeleton import trace_network
from pipeline.geometry.outline.outer_walls import count_islands, filled
from pipeline.geometry.wall_distance import distances_to_walls
from pipeline.mjcf.bundle import WorldRecord
from pipeline.params.made_by import MadeBy
from pipeline.proof.rebuilt.differences import first_difference
from pipeline.store.codecs import decode, encode
from pipeline.types import Areas, DriftNetwork, FreeSpace, Image, Occupancy

_M2 = 1.1e-3  # areas and lengths of the record have three decimals
_CM = 1.1e-2  # the network's lengths have two; another machine's library may round the other way
_CLEARANCE_M = 1e-4
_BORDER_M = 1e-6  # a cell whose centre is so near to a wall may be free or not
_MOST_MARGIN_M = 100.0  # of rock round the plan
_FINER = 4  # times that the network's cells may be halved, and the cells themselves


def require_remade(
    folder: Path, record: WorldRecord, free_space: FreeSpace, params: MadeBy, tolerance_m: float
) -> Occupancy:
    """Make the files and figures of a bundle again from its outline, compare them, and return the grid.

    Parameters
    ----------
    folder : Path
        A bundle that the tables of `pipeline.schema` allow.
    record : WorldRecord
    free_space : FreeSpace
        By `read_free_space`.
    params : MadeBy
        How its network is traced.
    tolerance_m : float
        The largest distance by which simplification may have moved a wall, m.

    Raises
    ------
    ArtifactError
        With the file, the first value that differs, and what it should be.
    """
    free = free_space.polygon
    _require_figures(folder, record, free_space, tolerance_m)
    _require_box(folder, record, free_space)
    _require_network(folder, record, free, params)
    grid = _require_grid(folder, record, free)
    _require_map_and_octree(folder, record, grid)
    _require_spawn(folder, record, grid)
    return grid


def read_free_space(folder: Path) -> FreeSpace:
    """Return the outline of the workings: one valid polygon in a file that holds nothing else.

    Raises
    ------
    ArtifactError
        If the file is not exactly as the pipeline writes it, or the outline is no valid polygon.
    """
    path = folder / FREE_SPACE
    free_space: FreeSpace = decode(path, FreeSpace)
    free = free_space.polygon
    if not isinstance(free, Polygon) or free.is_empty or free.has_z:
        raise ArtifactError(f"{path}: geometry: {free.geom_type}, want one polygon of two coordinates")
    if not np.isfinite(shapely.get_coordinates(free)).all() or not free.is_valid:
        raise ArtifactError(f"{path}: geometry: not a valid polygon: {shapely.is_valid_reason(free)}")
    numbers = [*vars(free_space.frame).values(), *vars(free_space.areas).values(), free_space.tolerance_m]
    if not all(map(math.isfinite, numbers)) or free_space.frame.px_per_m <= 0:
        raise ArtifactError(f"{path}: properties: {numbers}, want finite numbers and px_per_m above 0")
    if encode(path, free_space) != path.read_bytes():
        raise ArtifactError(f"{path}: holds more than an outline and its properties, or is written in another way")
    return free_space


def _require_figures(folder: Path, record: WorldRecord, free_space: FreeSpace, tolerance_m: float) -> None:
    """Compare frame, tolerance and areas."""
    path, free, stated = folder / FREE_SPACE, free_space.polygon, free_space.areas
    for name, one, two in (("plan_frame", record.plan_frame, free_space.frame), ("areas", record.areas, stated)):
        differs = first_difference(dataclasses.asdict(one), dataclasses.asdict(two), 0.0, name)
        if differs:
            raise ArtifactError(f"{folder / RECORD}: {differs}, as {FREE_SPACE} states")
    if not 0 <= free_space.tolerance_m <= tolerance_m:
        raise ArtifactError(f"{path}: tolerance_m = {free_space.tolerance_m}, want 0 to {tolerance_m}")
    outer = filled(free)
    plan = shapely.box(*free_space.frame.extent_m)
    made = Areas(
        tunnel_m2=round(free.area, 3),
        islands_m2=round(outer.area - free.area, 3),
        outside_m2=round(plan.difference(outer).area, 3),
        islands=count_islands(free),
        traced_tunnel_m2=stated.traced_tunnel_m2,
        unconnected_m2=stated.unconnected_m2,
    )
    differs = first_difference(dataclasses.asdict(stated), dataclasses.asdict(made), _M2, "areas")
    if differs:
        raise ArtifactError(f"{path}: {differs}, as the outline has")
    # Simplification moves a wall by at most the tolerance, so that the traced area lies within a strip of that width.
    strip = tolerance_m * free.length
    if (
        abs(stated.traced_tunnel_m2 - free.area) > strip
        or not 0 <= stated.unconnected_m2 <= plan.area - free.area + _M2
    ):
        raise ArtifactError(
            f"{path}: areas: traced_tunnel_m2 = {stated.traced_tunnel_m2}, unconnected_m2 = {stated.unconnected_m2}; "
            f"the outline has {free.area:.3f} m2 and may have lost {strip:.3f} m2"
        )
    if not plan.buffer(tolerance_m + 1 / free_space.frame.px_per_m).contains(free):
        raise ArtifactError(f"{path}: the outline leaves the plan's frame {list(free_space.frame.extent_m)}")


def _require_box(folder: Path, record: WorldRecord, free_space: FreeSpace) -> None:
    """Compare the box of the rock with plan, workings and one margin on all sides, in whole decimetres."""
    plan, workings = free_space.frame.extent_m, free_space.polygon.bounds
    sides = [min(a, b) - w for a, b, w in zip(plan[:2], workings[:2], record.world_m[:2], strict=True)]
    sides += [w - max(a, b) for a, b, w in zip(plan[2:], workings[2:], record.world_m[2:], strict=True)]
    # A side is rounded outwards to a decimetre: the margin is what it has, or up to 0.1 m less.
    least, most = max(sides) - 0.1 - 1e-6, min(sides) + 1e-6
    decimetres = 10 * np.array(record.world_m)
    if least > most or not 0 < most <= _MOST_MARGIN_M + 0.1 or np.abs(decimetres - decimetres.round()).max() > 1e-6:
        raise ArtifactError(
            f"{folder / RECORD}: world_m = {list(record.world_m)}: rock reaches {[round(s, 3) for s in sides]} m "
            f"beyond plan and workings; want one margin of at most {_MOST_MARGIN_M:g} m, to the decimetre"
        )


def _require_network(folder: Path, record: WorldRecord, free: Polygon, params: MadeBy) -> None:
    path = folder / TOPOLOGY
    stated: DriftNetwork = decode(path, DriftNetwork)
    if encode(path, stated) != path.read_bytes():
        raise ArtifactError(f"{path}: holds more than a drift network, or is written in another way")
    cells = [params.network_cell_m / 2**k for k in range(_FINER)]
    if not any(math.isclose(stated.cell_m, cell) for cell in cells):
        raise ArtifactError(f"{path}: cell_m = {stated.cell_m}, want one of {cells}")
    grid = stated.cell_m, params.network_min_leg_m, params.network_station_spacing_m
    try:
        made = trace_network(free, *grid)
    except GeometryError as error:
        raise ArtifactError(f"{folder / FREE_SPACE}: {error}") from error
    differs = first_difference(json.loads(encode(path, stated)), json.loads(encode(path, made)), _CM)
    if differs:
        raise ArtifactError(f"{path}: {differs}, as the outline has")
    if (record.loops, record.drifts) != (made.loops, len(made.legs)):
        raise ArtifactError(
            f"{folder / RECORD}: loops = {record.loops}, drifts = {record.drifts}; want {made.loops}, {len(made.legs)}"
        )


def _require_grid(folder: Path, record: WorldRecord, free: Polygon) -> Occupancy:
    """Compare every cell of the clearance grid, free or not, and its clearance."""
    path = folder / CLEARANCE_GRID
    stated: Occupancy = decode(path, Occupancy)
    made = occupancy_grid(free, float(stated.cell_m), record.world_m)
    row, col = np.nonzero(made.free != stated.free)
    centres = made.origin_m + (np.column_stack([col, row]) + 0.5) * made.cell_m
    wrong = np.flatnonzero(distances_to_walls(free, centres) > _BORDER_M)
    if len(wrong):
        x, y = centres[wrong[0]]
        raise ArtifactError(f"{path}: free: {len(wrong)} cells differ from the outline, one at ({x:.3f}, {y:.3f}) m")
    off = np.abs(made.clearance_m - stated.clearance_m)
    if off.max() > _CLEARANCE_M:
        at = np.unravel_index(int(off.argmax()), off.shape)
        raise ArtifactError(
            f"{path}: clearance_m[{at[0]}, {at[1]}] = {stated.clearance_m[at]:.4f}, want {made.clearance_m[at]:.4f}"
        )
    return Occupancy(stated.free, made.clearance_m, made.origin_m, made.cell_m)


def _require_map_and_octree(folder: Path, record: WorldRecord, grid: Occupancy) -> None:
    path, (pixels, text) = folder / NAV2_MAP, nav2_map(grid)
    if path.read_bytes() != text.encode():
        raise ArtifactError(f"{path}: not the map of the clearance grid; want {text!r}")
    picture = decode(path.with_suffix(".png"), Image)
    if picture.shape != pixels.shape or (picture != pixels).any():
        raise ArtifactError(f"{path.with_suffix('.png')}: pixels differ from the clearance grid")
    columns = Columns.of_cells(np.argwhere(grid.free), grid.origin_m, grid.cell_m, record.height_m)
    made = to_bt(build_octree(columns, grid.cell_m))
    if (folder / OCTREE).read_bytes() != made:
        raise ArtifactError(
            f"{folder / OCTREE}: not the octree of the clearance grid and the height {record.height_m} m"
        )


def _require_spawn(folder: Path, record: WorldRecord, grid: Occupancy) -> None:
    stated = record.spawn
    try:
        made = entrance_anchor(grid, stated.centre_m, stated.radius_m, stated.clearance_m)
    except GeometryError as error:
        raise ArtifactError(f"{folder / RECORD}: {error}") from error
    as_json = TypeAdapter(type(made)).dump_python
    differs = first_difference(as_json(stated), as_json(made), _CLEARANCE_M, "spawn")
    if differs:
        raise ArtifactError(f"{folder / RECORD}: {differs}, by the clearance grid")
