"""The network of flying times of a mine, level or one volume: heights over columns, and the cubes in view from them."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from baselines.oracle.air_views import cubes_in_view
from baselines.oracle.bands import BESIDE, cut_into_bands, joined_pairs
from baselines.oracle.network import _METRIC, _SINK_M, TimeNetwork
from minexplore.envs.flyer_batch import FlyerBatch
from minexplore.volume.air import AirSpans
from minexplore.world import World

_MARGIN = 1.02  # of speed: the fastest mean over 4 s was 0.99 of that without it, and a controller may pass it for less


def network_in_air(batch: FlyerBatch, band_s: float) -> TimeNetwork:
    """Return the network of bands of a robot that flies, each with the cubes in view from it; see `time_network`.

    A node is no floor but the free heights over a column of the plan: one in a level mine, one in each storey of a
    volume, the whole height of a shaft. No robot sees more than this network lets it, for four reasons.

    Ways. A flight is a line in free space. Seen from above it passes from column to column, and at the border of two it
    is at one height, which both have free. So it is a way on the network, as long as the flight is seen from above, and
    a flight is never shorter than that. Climbs take no time.

    Room. In a level mine a robot stays as far from rock as the default one. In a volume it may be in any column whose
    middle is free, however narrow. A robot that leans by up to 60 deg covers the middle of its column, and all of it
    is within `reach` of its own middle, so heights are widened by that.

    Speed. It is that of `fastest_in_plan_mps` everywhere: floor zones have no effect.

    Views. A beam is a line in free space too, see `cubes_in_view`.

    Parameters
    ----------
    batch : FlyerBatch
    band_s : float
    """
    world, robot = batch.world, batch.robot
    free, standing = free_columns(world, robot.radius_m - _SINK_M)
    numbers = np.flatnonzero(standing)
    air, reach = free.within(numbers), float(np.hypot(robot.radius_m, robot.half_height_m))
    heights = air.floor_m - reach, air.floor_m + air.headroom_m + reach
    pairs, length = joined_pairs(air.column, air.row, *heights)
    graph = coo_matrix((length * air.cell_m / fastest_in_plan_mps(batch), pairs.T), shape=(len(numbers),) * 2).tocsr()
    start = _nearest(air, batch.ground.start_m)
    times = dijkstra(graph, directed=False, indices=start) / _METRIC
    bands = cut_into_bands(times, joined_pairs(air.column, air.row, *heights, BESIDE)[0], band_s)
    return bands.network(start, cubes_in_view(free, batch.task.range_m[1], batch.grid, numbers, bands.regions))


def free_columns(world: World, clearance_m: float) -> tuple[AirSpans, np.ndarray]:
    """Return the free heights over columns of a world, and a mask of those in which a robot may be.

    In a level mine these have at least a clearance; in a volume they are all.
    """
    if world.volume is not None:
        spans = world.volume.spans
        free = AirSpans(spans.column, spans.row, spans.floor_m, spans.headroom_m, spans.origin_m, spans.cell_m)
        return free, np.ones(len(spans.column), bool)
    row, col = np.nonzero(world.clearance_m > 0)
    roof_m = np.full(len(row), float(world.record["height_m"]))
    free = AirSpans(col, row, np.zeros(len(row)), roof_m, world.origin_m, world.cell_m)
    return free, world.clearance_m[row, col] >= clearance_m


def fastest_in_plan_mps(batch: FlyerBatch) -> float:
    """Return the fastest speed (m/s) along the plane of the mine.

    A robot follows a level velocity w that turns with it at a rate r: its controller pushes by its gain k times the
    difference to w, and by r times w at a right angle. Commanded anew so that it keeps a heading while the robot turns,
    w is passed: the robot flies as fast as w and r w / k together. Along a plane that leans it climbs at once.
    """
    task, robot = batch.task, batch.robot
    level_mps = task.max_forward_mps * float(np.hypot(1.0, task.max_turn_radps / robot.velocity_gain_ps))
    cos = float(batch.world.T_world_mine[2, 2]) if task.tilt else 1.0
    sin = float(np.sqrt(max(0.0, 1.0 - cos**2)))
    return _MARGIN * (level_mps * cos + robot.climb_mps * sin)


def _nearest(air: AirSpans, place_m: np.ndarray) -> int:
    """Return the span of the column of a place (3,) m, or of the nearest column, that has its height or is nearest."""
    cell = np.floor((place_m[:2] - air.origin_m) / air.cell_m)
    top_m = air.floor_m + air.headroom_m
    up = np.maximum(np.maximum(air.floor_m - place_m[2], place_m[2] - top_m), 0.0)
    return int(((air.column - cell[0]) ** 2 + (air.row - cell[1]) ** 2 + up**2).argmin())
