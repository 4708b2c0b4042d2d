"""Whether the parts of a bundle agree: the record, the compiled model, and the grids in the bundle."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import CLEARANCE_GRID, MINE_BODY, NAV2_MAP, OCTREE, GeomGroup, is_floor, sheet_map, zone_of_wedge
from minexplore.floors.floor import Floor
from pipeline.geometry.floor.parts import wall_lines
from pipeline.geometry.maps.octree import FREE, Octree, from_bt
from pipeline.geometry.wall_distance import distances_to_walls
from pipeline.mjcf.bundle import OpenedBundle, mine_from_body, read_floor
from pipeline.store.codecs import decode
from pipeline.survey.grid.nav2 import read_nav2_map
from pipeline.types import FreeSpace, Occupancy

_GRAVITY = (0.0, 0.0, -9.81)
_LEVEL = 1e-3
_KNEE_M, _CELLS_TRIED = 0.4, 5000
_BORDER_SHARE = 2**-0.5  # of a cell: a cell nearer to a wall than this may be free or not


def measure_consistency(folder: Path, world: OpenedBundle, free_space: FreeSpace) -> dict[str, Any]:
    """Return counts and errors: how far the files of a bundle differ from its record and from its model."""
    model, record = world.model, world.record
    w, _, y, _ = model.body(MINE_BODY).quat
    tilt_deg = math.degrees(2 * math.atan2(y, w))
    anchor, floor = shapely.Point(record.spawn.anchor_m), read_floor(folder, record)
    walls = wall_lines(free_space.polygon, floor)
    inside = shapely.contains(free_space.polygon, anchor)
    return {
        "tilt_deg": round(tilt_deg, 4),
        "tilt_error_deg": round(abs(tilt_deg - record.tilt_deg), 6),
        "frame_error_m": _frame_error_m(world),
        "gravity_error": round(float(np.abs(model.opt.gravity - _GRAVITY).max()), 6),
        "lights_missing": abs(record.lights - int(model.nlight)),
        "zones_wrong": _zones_wrong(world),
        "friction_error": _rock_friction_error(world),
        "colliders_wrong": _colliders_wrong(world),
        "spawn_clearance_m": round(anchor.distance(walls) if inside else 0.0, 4),
        **_grid_errors(folder, free_space, floor, walls),
    }


def _frame_error_m(world: OpenedBundle) -> float:
    """Return the largest distance, m, between the mine's corners in the model and in the record's frame."""
    west, south, east, north = world.record.world_m
    corners = np.array([[x, y, 0.0] for x in (west, east) for y in (south, north)])
    T = mine_from_body(world.model, np.array(world.record.T_world_mine))
    return round(float(np.abs(corners @ T[:3, :3].T + T[:3, 3] - corners).max()), 9)


def _zones_wrong(world: OpenedBundle) -> int:
    """Count the floor zones whose geom is missing or differs from the record in place or friction, and extra geoms."""
    wrong, names = 0, [world.model.geom(g).name for g in range(world.model.ngeom)]
    if world.record.heights:
        return _wedges_wrong(world, [name for name in names if is_floor(name)])
    for zone in world.record.zones:
        if zone.geom not in names:
            wrong += 1
            continue
        geom = world.model.geom(zone.geom)
        low, high = geom.pos - geom.size, geom.pos + geom.size
        modelled = [low[0], high[0], low[1], high[1], high[2], geom.friction[0]]
        recorded = [zone.west_m, zone.east_m, zone.south_m, zone.north_m, 0.0, zone.friction]
        wrong += not (np.abs(np.array(modelled) - recorded).max() < _LEVEL and geom.priority[0] == 1)
    return wrong + abs(sum(is_floor(name) for name in names) - len(world.record.zones))


def _wedges_wrong(world: OpenedBundle, names: list[str]) -> int:
    """Count the wedges of the floor that belong to no zone or have another friction than theirs, and missing ones."""
    friction = {zone.geom: zone.friction for zone in world.record.zones}
    geoms = [world.model.geom(name) for name in names]
    off = [abs(geom.friction[0] - friction.get(zone_of_wedge(geom.name), np.inf)) for geom in geoms]
    wrong = sum(not (error < _LEVEL and geom.priority[0] == 1) for error, geom in zip(off, geoms, strict=True))
    return wrong + abs(len(names) - (world.record.heights.floor_wedges if world.record.heights else 0))


def _colliders_wrong(world: OpenedBundle) -> int:
    """Count geoms that wrongly collide or wrongly do not, and solid geoms of a wrong shape or body.

    Only rock, floor and roof collide. They are convex meshes or boxes, and belong to the body `mine`, because every
    measure reads their positions in its frame.
    """
    model = world.model
    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    solid = np.isin(model.geom_group, [GeomGroup.COLLISION, GeomGroup.FLOOR, GeomGroup.ROOF])
    allowed_shape = np.isin(model.geom_type, [mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_BOX])
    of_other_body = model.geom_bodyid != model.body(MINE_BODY).id
    return int((collides != solid).sum() + (solid & ~allowed_shape).sum() + (solid & of_other_body).sum())


def _rock_friction_error(world: OpenedBundle) -> float:
    rock = world.model.geom_group == GeomGroup.COLLISION
    error = np.abs(world.model.geom_friction[rock, 0] - world.record.rock_friction)
    return round(float(error.max(initial=0.0)), 6)


def _grid_errors(folder: Path, free_space: FreeSpace, floor: Floor, walls: BaseGeometry) -> dict[str, int]:
    """Count cells of clearance grid, Nav2 map and octree that differ from the free space, except at its border."""
    grid = decode(folder / CLEARANCE_GRID, Occupancy)
    free, origin, cell = grid.free, grid.origin_m, float(grid.cell_m)
    maps = {NAV2_MAP: (free_space.polygon, np.zeros(2))}  # the workings that each shows, and how far it is moved
    if len(floor.offset_m) > 1:
        parts = zip(shapely.get_parts(free_space.polygon), floor.offset_m, strict=True)
        maps |= {sheet_map(sheet)[0]: place for sheet, place in enumerate(parts)}
    tree = from_bt(decode(folder / OCTREE, bytes))
    return {
        "occupancy_wrong": _wrong_cells(free, origin, cell, free_space.polygon)
        + _wrong_clearances(free, grid.clearance_m, origin, cell, walls),
        "map_wrong": sum(_wrong_map(folder / name, *place) for name, place in maps.items()),
        "octree_wrong": _wrong_voxels(tree, free, origin, cell, floor),
    }


def _wrong_map(path: Path, polygon: BaseGeometry, offset_m: np.ndarray) -> int:
    """Count the cells of a Nav2 map that differ from workings that lie `offset_m` (2,) beside it in the plan."""
    nav2 = read_nav2_map(path)
    return _wrong_cells(nav2.free, np.array(nav2.origin_m) + offset_m, nav2.cell_m, polygon)


def _wrong_cells(free: np.ndarray, origin_m: np.ndarray, cell_m: float, polygon: Polygon) -> int:
    """Count cells that differ from the polygon by more than half a diagonal, and cells missing at the grid's edge."""
    rows, cols = free.shape
    grid_box = shapely.box(*origin_m, origin_m[0] + cols * cell_m, origin_m[1] + rows * cell_m)
    missing = int(np.ceil(polygon.difference(grid_box).area / cell_m**2))
    places = _centres(free.shape, origin_m, cell_m)
    inside = shapely.contains_xy(polygon, places[:, 0], places[:, 1])
    differ = places[inside != free.ravel()]
    return missing + int((distances_to_walls(polygon, differ) > _BORDER_SHARE * cell_m).sum())


def _wrong_clearances(
    free: np.ndarray, clearance_m: np.ndarray, origin_m: np.ndarray, cell_m: float, walls: BaseGeometry
) -> int:
    """Return how many of about 5,000 free cells have a clearance with an error of more than one cell."""
    sample = np.flatnonzero(free.ravel())
    sample = sample[:: max(1, len(sample) // _CELLS_TRIED)]
    exact = distances_to_walls(walls, _centres(free.shape, origin_m, cell_m)[sample])
    return int((np.abs(exact - clearance_m.ravel()[sample]) > cell_m).sum())


def _wrong_voxels(tree: Octree, free: np.ndarray, origin_m: np.ndarray, cell_m: float, floor: Floor) -> int:
    """Count grid cells that the octree classifies differently at knee height; with heights, free cells only."""
    places = np.column_stack([_centres(free.shape, origin_m, cell_m), np.full(free.size, _KNEE_M)])
    if not floor.is_flat:
        return int((tree.query(floor.fold(places[free.ravel()])) != FREE).sum())
    return int(((tree.query(places) == FREE) != free.ravel()).sum())


def _centres(shape: tuple[int, ...], origin_m: np.ndarray, cell_m: float) -> np.ndarray:
    """Return the centres of all cells, (n, 2) m, row by row from the south."""
    rows, cols = np.indices(shape)
    return np.asarray(origin_m) + (np.stack([cols, rows], axis=-1).reshape(-1, 2) + 0.5) * cell_m
