"""The containment certificate: proof, clause by clause, that a bundle's collision geometry encloses the workings.

The shapes are those of the compiled model. They are sliced in the mine frame of `world.json`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import GeomGroup
from minexplore.floors.floor import Floor
from pipeline.geometry.floor.parts import wall_lines
from pipeline.geometry.floor.seams import continue_sheets, seam_lines
from pipeline.geometry.floor.sheet_rock import beside_sheets
from pipeline.geometry.floor.sheets import floor_seams
from pipeline.geometry.floor.wall_foot import BAND_M, WallFoot
from pipeline.geometry.rock.extrude import section_footprint
from pipeline.geometry.wall_distance import distances_to_walls
from pipeline.metrics.containment import cover_walls, open_area_m2
from pipeline.metrics.reach import compare_sheets, reached_cells, start_cell
from pipeline.mjcf.bundle import OpenedBundle, WorldRecord, mine_from_body, obstacles, placed_parts, read_floor
from pipeline.mjcf.clearance import rock_clearance
from pipeline.params.validation import CertificateParams, Limit
from pipeline.proof.floor import enclosure_of_floor
from pipeline.proof.standing import measure_standing
from pipeline.proof.stress_test import Progress, stress_walls
from pipeline.types import Frame, FreeSpace, Openings

_SLICES_M = (0.05, 0.5, 1.0)  # one more slice is just below the roof
_LEVEL_M = 1e-3
_LEVEL_RAD = 1e-6  # half a millimetre at the far end of the longest slab
_MARGIN_M = 4.0  # grid beyond the workings, within the rock's box in plan, so that a leak is visible
_PROBE_HEIGHT_M = 0.35
_ON_SEAM_M = 1e-4
_ROWS = 64  # of the grid, at once
_ROUNDING_M = 1e-5  # clearances this close are equal: walls may run exactly at the radius beside a row of cells
_COMPARED_M = 0.25  # clearances are compared up to the robot's radius plus this


@dataclass(frozen=True)
class Clause:
    """One measured figure, its limits, and whether it is within them; a figure that is not measured is not."""

    value: float | None
    limit: dict[str, float]
    holds: bool


@dataclass(frozen=True)
class Certificate:
    """All clauses of one world, and whether all hold; `contacts` is the number of robot steps that touched rock."""

    world_sha256: str
    holds: bool
    contacts: int
    clauses: dict[str, Clause]


def measure_containment(
    folder: Path,
    world: OpenedBundle,
    free_space: FreeSpace,
    params: CertificateParams,
    network: tuple[float, float],
    threads: int = 1,
    progress: Progress = iter,
) -> dict[str, Any]:
    """Measure walls, floor, roof, reachable area, robots that stand and climb, and the stress test of a bundle.

    Parameters
    ----------
    folder : Path
    world : OpenedBundle
        The bundle, opened.
    free_space : FreeSpace
        The plan's free space, which the bundle must enclose.
    params : CertificateParams
    network : (cell_m, min_leg_m)
        Parameters with which drift networks are traced.
    threads : int
    progress : callable
        Wraps the indices of the rounds of throws, as `tqdm.tqdm` does.
    """
    record, free = world.record, free_space.polygon
    T_world_mine = np.array(record.T_world_mine)
    parts = placed_parts(world.model, GeomGroup.COLLISION, T_world_mine)
    floor, box = read_floor(folder, record), shapely.box(*record.world_m)
    if floor.is_flat:
        figures = _enclosure(world, free, box, parts)
    else:
        figures = enclosure_of_floor(world, free, floor, parts, (*_SLICES_M, record.height_m - 0.05))
    wall_m = free.length
    figures |= {f"{name}_um": round(1e6 * figures[f"{name}_m2"] / wall_m, 4) for name in ("intrusion", "missing")}
    figures |= _reach(folder, world, free_space, floor, params, network)
    if params.limits.keys() & {"rest_drift_m", "climb_share"}:
        figures |= dataclasses.asdict(measure_standing(folder, params.seed))
    if params.contacts:
        borders = [zone.east_m for zone in record.zones[:-1]]
        stress = stress_walls(folder, free, parts, borders, params.contacts, params.seed, threads, progress)
        figures |= {k: v for k, v in dataclasses.asdict(stress).items() if k != "targets"}
    return figures


def _enclosure(world: OpenedBundle, free: Polygon, box: Polygon, parts: list[np.ndarray]) -> dict[str, Any]:
    """Return the figures of walls, floor and roof of a flat world."""
    record, T_world_mine = world.record, np.array(world.record.T_world_mine)
    figures: dict[str, Any] = vars(cover_walls(parts, free, box, (*_SLICES_M, record.height_m - 0.05))).copy()
    # A slab between two slices, or a geom of another name, group or body, would be in none of them.
    solid = shapely.union_all(
        [section_footprint(part) for part in obstacles(world.model, T_world_mine, record.height_m)]
    )
    figures["intrusion_m2"] = max(figures["intrusion_m2"], round(float(solid.intersection(free).area), 6))
    figures["rock_round_m"] = round(float(free.distance(box.exterior)) if box.contains(free) else 0.0, 3)
    figures["floor_open_m2"] = open_area_m2(_slabs(world.model, GeomGroup.FLOOR, T_world_mine, 0.0, top=True), free)
    roof = _slabs(world.model, GeomGroup.ROOF, T_world_mine, record.height_m, top=False)
    figures["roof_open_m2"] = open_area_m2(roof, free)
    return figures


def _slabs(
    model: mujoco.MjModel, group: int, T_world_mine: np.ndarray, level_m: float, top: bool
) -> list[tuple[float, float, float, float]]:
    """Return the boxes (west, south, east, north) m of a group whose upper, or lower, face lies at a level."""
    found = []
    T, rotation = mine_from_body(model, T_world_mine), np.zeros(9)
    for geom in np.flatnonzero((model.geom_group == group) & (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)):
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
        level = np.allclose(T[:3, :3] @ rotation.reshape(3, 3), np.eye(3), atol=_LEVEL_RAD)
        (x, y, z), (a, b, c) = T[:3, :3] @ model.geom_pos[geom] + T[:3, 3], model.geom_size[geom]
        if level and abs(z + (c if top else -c) - level_m) < _LEVEL_M:
            found.append((x - a, y - b, x + a, y + b))
    return found


def _reach(
    folder: Path,
    world: OpenedBundle,
    free_space: FreeSpace,
    floor: Floor,
    params: CertificateParams,
    network: tuple[float, float],
) -> dict[str, Any]:
    free, record, cell, radius = free_space.polygon, world.record, params.cell_m, params.robot_radius_m
    west, south, east, north = free.bounds
    margin = np.ceil((_MARGIN_M + 2 * radius) / cell) * cell
    width, height = (int(np.ceil((high - low + 2 * margin) / cell)) for low, high in ((west, east), (south, north)))
    frame = Frame(1 / cell, (margin - west) / cell, (north + margin) / cell, width, height)
    most = radius + _COMPARED_M
    around = free.buffer(_MARGIN_M if floor.is_flat else BAND_M - cell / 2).intersection(shapely.box(*record.world_m))
    around = around.difference(shapely.union_all(beside_sheets(floor, record.height_m)))
    around = around.difference(_not_compared(record, most))
    around = around.difference(_seam_lines(free, floor))
    queried, places = _cells_within(around, frame)
    plan, measured = np.zeros(width * height), np.zeros(width * height)
    is_inside = shapely.contains_xy(free, *places.T)
    plan[queried[is_inside]] = _plan_clearance(free, floor, places[is_inside], most)
    if record.openings and not record.fenced:  # nothing stands at their edges: the plan alone keeps robots off
        near, beside = _cells_within(free, frame)
        only = ~np.isin(near, queried)
        near, beside = near[only], beside[only]
        plan[near] = _plan_clearance(free, floor, beside, most)
        measured[near] = plan[near]
    T = np.array(record.T_world_mine)
    probes = _probes(floor, places, is_inside)
    measured[queried] = rock_clearance(folder, T, GeomGroup.COLLISION, probes, most)
    start, seams = start_cell(record.spawn.anchor_m, frame), floor_seams(floor)
    error = np.abs(plan - measured)
    rounded = np.where(error <= _ROUNDING_M, plan, measured)
    by_plan, by_world = (reached_cells(c.reshape(height, width), radius, start, frame, seams) for c in (plan, rounded))
    clearance_error_m = round(float(error.max()), 5)
    if not (by_plan.any() and by_world.any()):  # the anchor itself is in rock
        return {"clearance_error_m": clearance_error_m, "reached_m2": 0.0, "same_graph": False}
    match = compare_sheets(
        by_plan, by_world, frame, [part.bounds for part in shapely.get_parts(free)], radius, *network
    )
    return {"clearance_error_m": clearance_error_m, **vars(match)}


def _plan_clearance(free: BaseGeometry, floor: Floor, places_m: np.ndarray, most_m: float) -> np.ndarray:
    """Return how far (n,) m places (n, 2) m of the workings are from walls in plan, at most `most_m`.

    Near a seam the walls of the next sheet count as well: they may turn inwards just behind it.
    """
    clearance = np.minimum(distances_to_walls(wall_lines(free, floor), places_m), most_m)
    seams = seam_lines(floor)
    if not seams:
        return clearance
    points = shapely.points(places_m)
    for sheet, whole in enumerate(continue_sheets(free, floor, 2 * most_m)):
        lines = shapely.multilinestrings([seam.line_in(sheet) for seam in seams if sheet in seam.sheets])
        near = np.flatnonzero(shapely.dwithin(points, lines, most_m)) if not lines.is_empty else np.zeros(0, np.int64)
        near = near[floor.sheets_at(places_m[near]) == sheet]
        if len(near):
            walls = whole.boundary.intersection(lines.buffer(2 * most_m))
            clearance[near] = np.minimum(clearance[near], shapely.distance(walls, points[near]))
    return clearance


def _cells_within(area: BaseGeometry, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers (k,) of the cells whose middles lie in an area, and these (k, 2) m.

    Row by row: a plan of many sheets is nearly empty, and places of all its cells take gigabytes.
    """
    shapely.prepare(area)
    cols, found = np.arange(frame.width_px), [(np.zeros(0, np.int64), np.zeros((0, 2)))]
    for row in range(0, frame.height_px, _ROWS):
        rows = np.arange(row, min(row + _ROWS, frame.height_px))
        cells = np.column_stack([np.tile(cols, len(rows)), np.repeat(rows, len(cols))])
        places = frame.to_mine(cells + 0.5)
        at = np.flatnonzero(shapely.contains_xy(area, *places.T))
        found.append((at + row * frame.width_px, places[at]))
    return np.concatenate([numbers for numbers, _ in found]), np.concatenate([places for _, places in found])


def _seam_lines(free: Polygon, floor: Floor) -> BaseGeometry:
    """Return a strip of 0.1 mm along the seams of sheets: a place on one is in neither sheet, nor in rock."""
    if len(floor.offset_m) == 1:
        return Polygon()
    walls = wall_lines(free, floor)
    return free.boundary.difference(walls.buffer(_ON_SEAM_M)).buffer(_ON_SEAM_M, cap_style="flat")


def _not_compared(record: WorldRecord, most_m: float) -> BaseGeometry:
    """Return where clearances of plan and world differ: within openings in the floor, and near to unfenced ones."""
    holes = [Polygon(opening.outline_m) for opening in Openings(record.openings).collars]
    return shapely.union_all(holes if record.fenced else shapely.buffer(holes, most_m))


def _probes(floor: Floor, places_m: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Return probes (k, 3) m, mine frame, over places (k, 2) m of the plan: `_PROBE_HEIGHT_M` above their floor.

    In the rock beside the workings that is the floor at the nearest wall, which the wall's parts follow. The mesh has
    no height there: the plane of a face nearby may be metres below the wall's foot.
    """
    points = np.column_stack([places_m, np.full(len(places_m), _PROBE_HEIGHT_M)])
    if floor.is_flat:
        return points
    points[inside] = floor.fold(points[inside])
    beside = places_m[~inside]
    points[~inside, :2] -= floor.offsets_at(beside)
    points[~inside, 2] += WallFoot(floor).heights_at(beside)
    return points


def certify(world_sha256: str, measured: Mapping[str, Any], limits: Mapping[str, Limit]) -> Certificate:
    """Compare the measured figures with the limit of each clause."""
    clauses = {}
    for name, limit in limits.items():
        value = measured.get(name)
        bounds = {k: v for k, v in limit.model_dump().items() if v is not None}
        clauses[name] = Clause(
            None if value is None else float(value), bounds, value is not None and limit.holds(value)
        )
    return Certificate(world_sha256, all(c.holds for c in clauses.values()), int(measured.get("contacts", 0)), clauses)
