"""The containment certificate: proof, clause by clause, that a bundle's collision geometry encloses the workings.

The shapes are those of the compiled model. They are sliced in the mine frame of `world.json`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import mujoco
import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import GeomGroup
from pipeline.geometry.rasterize import fill_polygon
from pipeline.geometry.rock.extrude import section_footprint
from pipeline.geometry.wall_distance import distances_to_walls
from pipeline.metrics.containment import cover_walls, depth_m, open_area_m2
from pipeline.metrics.reach import compare_reach, reached_cells, start_cell
from pipeline.mjcf.bundle import OpenedBundle, mine_from_body, obstacles, placed_parts
from pipeline.mjcf.clearance import rock_clearance
from pipeline.params.validation import CertificateParams, Limit
from pipeline.proof.stress_test import stress_walls
from pipeline.types import Frame, FreeSpace, Mask

_SLICES_M = (0.05, 0.5, 1.0)  # one more slice is just below the roof
_LEVEL_M = 1e-3
_LEVEL_RAD = 1e-6  # half a millimetre at the far end of the longest slab
_MARGIN_M = 4.0  # grid beyond the workings, within the rock's box in plan, so that a leak is visible
_PROBE_HEIGHT_M = 0.35
_ROUNDING_M = 1e-5  # clearances this close are equal: walls may run exactly at the radius beside a row of cells
_AT_ONCE = 1_000_000  # cells that are measured
COMPARED_M = 0.25  # clearances are compared up to the robot's radius plus this


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
) -> dict[str, Any]:
    """Measure walls, floor, roof, reachable area, and the stress test of a bundle.

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
    """
    record, free = world.record, free_space.polygon
    T_world_mine = np.array(record.T_world_mine)
    parts = placed_parts(world.model, GeomGroup.COLLISION, T_world_mine)
    figures = _enclosure(world, free, shapely.box(*record.world_m), parts)
    figures |= _reach(folder, world, free_space, params, network)
    if params.contacts:
        borders = [zone.east_m for zone in record.zones[:-1]]
        stress = stress_walls(folder, free, parts, borders, params.contacts, params.seed, threads)
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
    inside = solid.intersection(free)
    figures["intrusion_m2"] = max(figures["intrusion_m2"], round(float(inside.area), 6))
    figures["intrusion_mm"] = max(figures["intrusion_mm"], round(1e3 * depth_m(inside, free), 6))
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
    params: CertificateParams,
    network: tuple[float, float],
) -> dict[str, Any]:
    free, record, cell, radius = free_space.polygon, world.record, params.cell_m, params.robot_radius_m
    west, south, east, north = free.bounds
    margin = np.ceil((_MARGIN_M + 2 * radius) / cell) * cell
    width, height = (int(np.ceil((high - low + 2 * margin) / cell)) for low, high in ((west, east), (south, north)))
    frame = Frame(1 / cell, (margin - west) / cell, (north + margin) / cell, width, height)
    most = radius + COMPARED_M
    around = free.buffer(_MARGIN_M).intersection(shapely.box(*record.world_m))
    queried = _cells_within(around, frame)
    places = _places(queried, frame)
    plan = _plan_clearance(free, places, most)
    measured = rock_clearance(folder, np.array(record.T_world_mine), GeomGroup.COLLISION, places, most)
    del places  # of a mine of 200 km a gigabyte
    error = np.abs(plan - measured)
    rounded = np.where(error <= _ROUNDING_M, plan, measured)
    start = start_cell(record.spawn.anchor_m, frame)
    by_plan, by_world = (reached_cells(_mask(queried[c >= radius], frame), start) for c in (plan, rounded))
    clearance_error_m = round(float(error.max()), 5)
    if not (by_plan.any() and by_world.any()):  # the anchor itself is in rock
        return {"clearance_error_m": clearance_error_m, "reached_m2": 0.0, "same_graph": False}
    match = compare_reach(by_plan, by_world, frame, radius, *network)
    return {"clearance_error_m": clearance_error_m, **vars(match)}


def _places(cells: np.ndarray, frame: Frame) -> np.ndarray:
    """Return the middles (k, 3), m, mine frame, of cells at the height where clearance is measured."""
    return np.column_stack([frame.to_mine(cells[:, ::-1] + 0.5), np.full(len(cells), _PROBE_HEIGHT_M)])


def _plan_clearance(free: Polygon, places: np.ndarray, most_m: float) -> np.ndarray:
    """Return the distance (k,), m, from places (k, 3), m, to the plan's walls, at most `most_m`; 0 in rock."""
    clearance = np.zeros(len(places))
    for some in np.array_split(np.arange(len(places)), len(places) // _AT_ONCE + 1):
        inside = some[shapely.contains_xy(free, *places[some, :2].T)]
        clearance[inside] = np.minimum(distances_to_walls(free, places[inside, :2]), most_m)
    return clearance


def _cells_within(area: BaseGeometry, frame: Frame) -> np.ndarray:
    """Return the rows and columns (k, 2) of the cells whose middles lie in an area."""
    filled = cv2.dilate(fill_polygon(area, frame).view(np.uint8), np.ones((3, 3), np.uint8))
    near = np.argwhere(filled).astype(np.int32)  # one cell more, as rounding may decide at the border
    shapely.prepare(area)
    parts = np.array_split(near, len(near) // _AT_ONCE + 1)
    return np.concatenate([some[shapely.contains_xy(area, *frame.to_mine(some[:, ::-1] + 0.5).T)] for some in parts])


def _mask(cells: np.ndarray, frame: Frame) -> Mask:
    """Return a mask (rows, cols) of cells (k, 2)."""
    mask = np.zeros((frame.height_px, frame.width_px), bool)
    mask[cells[:, 0], cells[:, 1]] = True
    return mask


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
