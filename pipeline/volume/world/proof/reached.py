"""Where robots get to from the spawn: by the map, and as robots drive there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import mujoco
import numpy as np

from minexplore.floors.volume_arrays import FacetLabel, FloorSpans, VolumeFacets
from minexplore.physics.robot import RobotParams
from minexplore.volume.columns import FloorColumns
from pipeline.volume.rock.ragged import parts_of
from pipeline.volume.shell import ShellPart
from pipeline.volume.world.proof.physics import add_robots, spec_of, stand
from pipeline.volume.world.proof.region import parts_about
from pipeline.volume.world.reach import RobotSize, covered, neighbours_of, regions_of, roomy_pairs_of

WAYS = 24  # robots, each on a way of its own
_WAY_M = 1.0
_SPEED_MPS, _TURN_PER_S = 0.4, 2.0  # of a robot, and by its angle off its course
_TIME_S, _CONTROL_S = 8.0, 0.1
_THERE_M, _PASSED_M = 0.15, 0.3  # from the way's end, seen from above, and from places before it
_SPARE_M = 0.01  # beside a robot that is steered along a way; one that touches rock may turn into it
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
    start = int(np.linalg.norm(cells.roomiest_m - spawn_m, axis=1).argmin())
    pairs = neighbours_of(cells, robot)
    region = regions_of(cells, start, robot)
    reached, largest = (float(covered(cells, pairs, region == k, robot).sum()) for k in (region[start], 0))
    cell_m2, floors = cells.cell_m**2, int((cells.storey >= 0).sum())
    figures = {
        "share": round(reached / len(region), 6),
        "of_largest": round(reached / largest, 6),
        "m2": round(reached * cell_m2, 3),
        "level_m2": round(floors * cell_m2, 3),
        "floor_m2": round(len(region) * cell_m2, 3),
    }
    roomy = roomy_pairs_of(cells, replace(robot, radius_m=robot.radius_m + _SPARE_M))
    return MapReach(figures, roomy, region == region[start])


def measure_drives(
    facets: VolumeFacets, parts: list[ShellPart], cells: FloorSpans, reach: MapReach, rng: np.random.Generator
) -> DrivenWays:
    """Drive robots from span to span, as the map joins them, on ways that are drawn.

    There are no ways where the map has none of 1 m to the east or the north.
    """
    ways = straight_ways(cells, reach.pairs[reach.middles[reach.pairs].all(axis=1)])
    if not len(ways):
        return DrivenWays(0, 0)
    ways = rng.choice(ways, min(WAYS, len(ways)), replace=False)
    places = cells.roomiest_m[np.where(rng.random(len(ways))[:, None] < 0.5, ways, ways[:, ::-1])]
    starts = places[:, 0]
    columns = FloorColumns(facets)
    normals = -facets.normals[columns.facets_under(starts + [0, 0, _LOOK_M])]  # noqa: RUF005
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    floor = facets.label == FacetLabel.FLOOR
    near = parts_about(parts_of([part.corners for part in parts]).boxes_m, places, _ABOUT_M)
    model = spec_of([parts[k] for k in near], add_robots(len(ways)), floor).compile()
    data, yaw = mujoco.MjData(model), np.arctan2(*(places[:, 1] - starts)[:, 1::-1].T)
    at = [stand(data, model, f"r{n}", starts[n], normals[n], float(yaw[n])) for n in range(len(ways))]
    return DrivenWays(len(ways), int(_drive(model, data, np.array(at), places).sum()))


def straight_ways(cells: FloorSpans, pairs: np.ndarray) -> np.ndarray:
    """Return the spans (n, k) of ways of 1 m to the east or the north, by pairs of neighbours."""
    count = round(_WAY_M / cells.cell_m)
    ways = [np.zeros((0, count + 1), np.int64)]
    east, north = ((axis[pairs[:, 1]] != axis[pairs[:, 0]]) for axis in (cells.column, cells.row))
    for some in (pairs[east & ~north], pairs[north & ~east]):
        following = np.arange(len(cells.column))
        following[some[:, 0]] = some[:, 1]
        chain = [np.arange(len(cells.column))]
        for _ in range(count):
            chain.append(following[chain[-1]])
        moved = np.all([one != other for one, other in pairwise(chain)], axis=0)
        ways.append(np.column_stack(chain)[moved])
    return np.concatenate(ways)


def _drive(model: mujoco.MjModel, data: mujoco.MjData, at: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Steer robots, whose free joints are `at` (n,) in qpos, from place to place (n, k, 3) m; return which arrive."""
    robot, every, last = RobotParams(), np.arange(len(at)), places.shape[1]
    place, turn, heading_for = at[:, None] + np.arange(3), at[:, None] + np.arange(3, 7), np.ones(len(at), int)
    for _ in range(round(_TIME_S / _CONTROL_S)):
        for _ in range(last):  # places may be so near each other that a robot is at several
            away = places[every, np.minimum(heading_for, last - 1), :2] - data.qpos[place][:, :2]
            near = np.where(heading_for < last - 1, _PASSED_M, _THERE_M)
            heading_for += (np.linalg.norm(away, axis=1) < near) & (heading_for < last)
        arrived = heading_for == last
        if arrived.all():
            break
        w, x, y, z = data.qpos[turn].T
        yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        off = (np.arctan2(away[:, 1], away[:, 0]) - yaw + np.pi) % (2 * np.pi) - np.pi
        speed = np.where(arrived, 0.0, _SPEED_MPS * np.maximum(np.cos(off), 0.0))
        speeds = robot.wheel_speeds(speed, np.where(arrived, 0.0, _TURN_PER_S * off))
        data.ctrl[:] = np.array(speeds).T.ravel()
        mujoco.mj_step(model, data, round(_CONTROL_S / model.opt.timestep))
    return heading_for == last
