"""The certificate's figures of a floor with heights: walls, floor and roof, exact over every triangle of the floor."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import shapely
from shapely import Polygon

from minexplore.bundle import SLAB_M, GeomGroup
from minexplore.floors.floor import Floor
from pipeline.geometry.rock.extrude import section_footprint
from pipeline.metrics.containment import STRIP_M, cover_floor
from pipeline.mjcf.bundle import OpenedBundle, obstacles, placed_parts
from pipeline.proof.openings import cover_openings, holes_in_roof, open_over_collars_m2
from pipeline.types import Openings

_ON_FLOOR_M = 0.01
_ROUND_M = 1e-4  # positions have four decimals
_INSIDE = 0.002  # share of a face that probes at its edges are moved towards its middle
_EDGE_M = 1e-3  # and at least so far from the edges: wedges have four decimals and straight edges to 0.1 mm
_ABOVE_M = 0.5  # of a probe over the floor


def enclosure_of_floor(
    world: OpenedBundle, free: Polygon, floor: Floor, parts: list[np.ndarray], slices_m: tuple[float, ...]
) -> dict[str, Any]:
    """Return the figures of walls, floor and roof of a world with heights.

    `floor_error_m` is the largest difference between the floor that wheels touch and the floor's mesh, at the middle
    and near the edges of every triangle.
    """
    T = np.array(world.record.T_world_mine)
    everything = obstacles(world.model, T, world.record.height_m)
    collars = [Polygon(opening.outline_m).exterior for opening in Openings(world.record.openings).collars]
    walls = cover_floor(everything, floor, slices_m, shapely.union_all(collars))
    shafts = cover_openings(world, floor, everything, slices_m)
    figures: dict[str, Any] = {name: max(value, vars(shafts)[name]) for name, value in vars(walls).items()}
    figures["rock_round_m"] = STRIP_M if figures["missing_m2"] < _ROUND_M * free.length else 0.0
    height_m = world.record.height_m
    roofed = free.difference(holes_in_roof(world, floor)) if world.record.openings else free
    for name, group, surface, area in (
        ("floor", GeomGroup.FLOOR, floor, free),
        ("roof", GeomGroup.ROOF, floor.raised(height_m), roofed),
    ):
        figures[f"{name}_open_m2"] = _open_m2(placed_parts(world.model, group, T), surface, area)
    figures["roof_open_m2"] = round(figures["roof_open_m2"] + open_over_collars_m2(world, floor), 6)
    figures["floor_error_m"] = _floor_error_m(world.model, T, floor)
    return figures


def _open_m2(wedges: list[np.ndarray], surface: Floor, free: Polygon) -> float:
    """Return the area of the workings, m2, over which no wedge has its inner face on the floor or the roof."""
    covered = []
    for inside in replace(surface, stretch=np.zeros(0)).unfold_bodies(wedges, 0.0):
        off = np.abs(inside[:, 2])
        if np.sort(off)[: len(off) // 2].max() < _ON_FLOOR_M and off.max() < SLAB_M + _ON_FLOOR_M:
            covered.append(section_footprint(inside).buffer(_ROUND_M))
    return round(float(free.difference(shapely.union_all(covered)).area), 6)


def _floor_error_m(model: mujoco.MjModel, T_world_mine: np.ndarray, floor: Floor) -> float:
    """Return the largest difference in height, m, between the wedges under rays from above and the floor's mesh.

    A ray nearer to an edge than `_EDGE_M` can pass beside a wall or between two wedges, where nothing that rolls can
    follow. Faces so thin that they have no other place are left out: each place on them is within 1.5 mm of an edge,
    and the faces beyond their edges are probed.
    """
    probes = _floor_probes(floor)
    starts = (probes + np.array([0.0, 0.0, _ABOVE_M])) @ T_world_mine[:3, :3].T + T_world_mine[:3, 3]
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    geoms = np.flatnonzero(model.geom_group == GeomGroup.FLOOR)
    boxes = [_box_in_plan(model, data, geom, T_world_mine) for geom in geoms.tolist()]
    ray, box = shapely.STRtree(boxes).query(shapely.points(probes[:, :2]), predicate="intersects")
    down, nearest = -T_world_mine[:3, 2].copy(), np.full(len(starts), np.inf)
    for k, geom in zip(ray.tolist(), geoms[box].tolist(), strict=True):
        far = _distance_to(model, data, geom, starts[k], down)
        if 0 <= far < nearest[k]:
            nearest[k] = far
    nearest[~np.isfinite(nearest)] = -1.0  # beside the floor, as MuJoCo states it
    return round(float(np.abs(nearest - _ABOVE_M).max()), 6)


def _box_in_plan(model: mujoco.MjModel, data: mujoco.MjData, geom: int, T_world_mine: np.ndarray) -> Polygon:
    """Return the box around a geom in plan, m."""
    middle, half = model.geom_aabb[geom][:3], model.geom_aabb[geom][3:]
    corners = middle + half * np.array(list(itertools.product((-1, 1), repeat=3)))
    corners = corners @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    x, y, _ = ((corners - T_world_mine[:3, 3]) @ T_world_mine[:3, :3]).T
    return shapely.box(x.min(), y.min(), x.max(), y.max()).buffer(_ROUND_M)


def _distance_to(model: mujoco.MjModel, data: mujoco.MjData, geom: int, start: np.ndarray, along: np.ndarray) -> float:
    """Return the distance, m, of a geom along a ray; -1 if it is beside the ray."""
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        return float(mujoco.mj_rayMesh(model, data, geom, start, along))
    place, axes = data.geom_xpos[geom], data.geom_xmat[geom]
    return float(mujoco.mju_rayGeom(place, axes, model.geom_size[geom], start, along, model.geom_type[geom]))


def _floor_probes(floor: Floor) -> np.ndarray:
    """Return the middle of each face and places near the middles of its edges (k, 3) m, in the mine frame."""
    corners = floor.vertices[floor.faces] - np.pad(floor.offset_m, [(0, 0), (0, 1)])[floor.sheet][:, None]
    (x, y), (u, v) = ((corners[:, k, :2] - corners[:, 0, :2]).T for k in (1, 2))
    longest = np.linalg.norm((corners - np.roll(corners, -1, axis=1))[:, :, :2], axis=2).max(axis=1)
    to_edge = np.abs(x * v - y * u) / np.maximum(longest, 1e-12) / 3  # of the middle from the nearest edge
    kept = to_edge > _EDGE_M
    middle = corners[kept].mean(axis=1, keepdims=True)
    edges = (corners[kept] + np.roll(corners[kept], -1, axis=1)) / 2
    moved = np.maximum(_INSIDE, _EDGE_M / to_edge[kept])[:, None, None]
    return np.concatenate([middle, edges + moved * (middle - edges)], axis=1).reshape(-1, 3)
