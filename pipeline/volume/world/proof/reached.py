"""Where robots get to from the spawn: by the map, and as robots drive there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from minexplore.floors.volume_arrays import FacetLabel, FloorSpans, VolumeFacets
from minexplore.physics.robot import RobotParams
from minexplore.volume.columns import FloorColumns
from pipeline.volume.shell import ShellPart
from pipeline.volume.world.proof.physics import add_robots, spec_of, stand
from pipeline.volume.world.reach import RobotSize, covered, neighbours_of, regions_of

WAYS = 24  # robots, each on a way of its own
_WAY_M = 1.0
_SPEED_MPS, _TURN_PER_S = 0.4, 2.0  # of a robot, and by its angle off its course
_TIME_S, _CONTROL_S = 8.0, 0.1
_THERE_M = 0.15  # from the way's end, seen from above
_ABOUT_M = 1.0  # about a way: a robot has a radius of 0.35 m and is 0.66 m high
_LOOK_M = 0.02  # over a span's middle: its floor is under it


@dataclass(frozen=True)
class DrivenWays:
    """Ways of 1 m that were driven, and the robots that came to their ends."""

    ways: int
    arrived: int


@dataclass(frozen=True)
class MapReach:
    """The reach of a robot from its spawn by the map: figures, pairs of spans, and where its middle gets to."""

    figures: dict[str, float]
    pairs: np.ndarray
    middles: np.ndarray


def reach_of(cells: FloorSpans, robot: RobotSize, spawn_m: Sequence[float]) -> MapReach:
    """Return what of the floors a robot gets to from a place (3,) m, as areas and as shares.

    `of_largest` is that of the largest floor that it can drive on from anywhere.
    """
    start = int(np.linalg.norm(cells.places_m - spawn_m, axis=1).argmin())
    pairs = neighbours_of(cells, robot)
    region = regions_of(cells, pairs, start, robot)
    reached, largest = (float(covered(cells, pairs, region == k, robot).sum()) for k in (region[start], 0))
    cell_m2, floors = cells.cell_m**2, int((cells.storey >= 0).sum())
    figures = {
        "share": round(reached / len(region), 6),
        "of_largest": round(reached / largest, 6),
        "m2": round(reached * cell_m2, 3),
        "level_m2": round(floors * cell_m2, 3),
        "floor_m2": round(len(region) * cell_m2, 3),
    }
    return MapReach(figures, pairs, region == region[start])


def measure_drives(
    facets: VolumeFacets, parts: list[ShellPart], cells: FloorSpans, reach: MapReach, rng: np.random.Generator
) -> DrivenWays:
    """Drive robots straight over spans that the map joins, on ways that are drawn.

    There are no ways where the map has no straight one of 1 m.
    """
    ways = straight_ways(cells, reach.pairs[reach.middles[reach.pairs].all(axis=1)])
    if not len(ways):
        return DrivenWays(0, 0)
    ways = rng.permuted(rng.choice(ways, min(WAYS, len(ways)), replace=False), axis=1)
    starts, ends = np.moveaxis(cells.places_m[ways], 1, 0)
    columns = FloorColumns(facets)
    normals = -facets.normals[columns.facets_under(starts + [0, 0, _LOOK_M])]  # noqa: RUF005
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    floor = facets.label == FacetLabel.FLOOR
    model = spec_of(_parts_about(parts, starts, ends), add_robots(len(ways)), floor).compile()
    data, yaw = mujoco.MjData(model), np.arctan2(*(ends - starts)[:, 1::-1].T)
    at = [stand(data, model, f"r{n}", starts[n], normals[n], float(yaw[n])) for n in range(len(ways))]
    return DrivenWays(len(ways), int(_drive(model, data, np.array(at), starts, ends).sum()))


def straight_ways(cells: FloorSpans, pairs: np.ndarray) -> np.ndarray:
    """Return the first and the last span (n, 2) of ways of 1 m to the east or the north, by pairs of neighbours."""
    ways = [np.zeros((0, 2), np.int64)]
    east = cells.column[pairs[:, 1]] > cells.column[pairs[:, 0]]
    for some in (pairs[east], pairs[~east]):
        following = np.arange(len(cells.column))
        following[some[:, 0]] = some[:, 1]
        ends = np.arange(len(cells.column))
        moved = np.ones(len(ends), bool)
        for _ in range(round(_WAY_M / cells.cell_m)):
            moved &= following[ends] != ends
            ends = following[ends]
        ways.append(np.column_stack([np.flatnonzero(moved), ends[moved]]))
    return np.concatenate(ways)


def _parts_about(parts: list[ShellPart], starts: np.ndarray, ends: np.ndarray) -> list[ShellPart]:
    """Return the parts whose boxes come near a way."""
    low, high = np.moveaxis(np.array([(p.corners.min(axis=0), p.corners.max(axis=0)) for p in parts]), 1, 0)
    near = np.zeros(len(parts), bool)
    for one, other in zip(starts, ends, strict=True):
        near |= ((low < np.maximum(one, other) + _ABOUT_M) & (high > np.minimum(one, other) - _ABOUT_M)).all(axis=1)
    return [parts[k] for k in np.flatnonzero(near)]


def _drive(
    model: mujoco.MjModel, data: mujoco.MjData, at: np.ndarray, starts: np.ndarray, ends: np.ndarray
) -> np.ndarray:
    """Steer robots, whose free joints are `at` (n,) in qpos, along ways (n, 3) m; return which come to the ends."""
    robot, arrived = RobotParams(), np.zeros(len(at), bool)
    place, turn = at[:, None] + np.arange(3), at[:, None] + np.arange(3, 7)
    ahead = (ends - starts)[:, :2] / np.linalg.norm((ends - starts)[:, :2], axis=1, keepdims=True)
    heading = np.arctan2(ahead[:, 1], ahead[:, 0])
    for _ in range(round(_TIME_S / _CONTROL_S)):
        away = ends[:, :2] - data.qpos[place][:, :2]
        left, beside = (away * ahead).sum(axis=1), away[:, 1] * ahead[:, 0] - away[:, 0] * ahead[:, 1]
        arrived |= (left < _THERE_M) & (np.abs(beside) < robot.radius_m)
        if arrived.all():
            break
        w, x, y, z = data.qpos[turn].T
        yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        off = (heading + np.arctan(beside) - yaw + np.pi) % (2 * np.pi) - np.pi
        speed = np.where(arrived, 0.0, _SPEED_MPS * np.maximum(np.cos(off), 0.0))
        speeds = robot.wheel_speeds(speed, np.where(arrived, 0.0, _TURN_PER_S * off))
        data.ctrl[:] = np.array(speeds).T.ravel()
        mujoco.mj_step(model, data, round(_CONTROL_S / model.opt.timestep))
    return arrived
