"""Which floor spans a robot gets to: slope, step, width and headroom, from span to span."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from minexplore.floors.volume_arrays import FloorSpans
from minexplore.volume.standing import neighbours, wide_pairs


@dataclass(frozen=True)
class RobotSize:
    """What a robot needs: steepest floor (rise over run), highest step m, height m and radius m."""

    steepest: float
    step_m: float
    height_m: float
    radius_m: float


def neighbours_of(cells: FloorSpans, robot: RobotSize) -> np.ndarray:
    """Return the pairs (n, 2) of spans whose floors a robot climbs; see `minexplore.volume.standing.neighbours`."""
    return neighbours(cells, robot.steepest, robot.step_m, robot.height_m)


def components_of(count: int, pairs: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """Return the number (count,) of the connected set of usable spans that each belongs to, -1 for others.

    The largest set has the number 0.
    """
    kept = pairs[usable[pairs].all(axis=1)]
    graph = coo_matrix((np.ones(len(kept)), kept.T), (count, count))
    _, label = connected_components(graph, directed=False)
    numbers, inverse, sizes = np.unique(label[usable], return_inverse=True, return_counts=True)
    rank = np.empty(len(numbers), np.int64)
    rank[np.argsort(-sizes, kind="stable")] = np.arange(len(numbers))
    found = np.full(count, -1)
    found[usable] = rank[inverse]
    return found


def roomy_pairs_of(cells: FloorSpans, robot: RobotSize) -> np.ndarray:
    """Return the pairs (n, 2) of spans between which a robot can drive; see `minexplore.volume.standing.wide_pairs`."""
    return wide_pairs(cells, robot.steepest, robot.step_m, robot.height_m, robot.radius_m)


def regions_of(cells: FloorSpans, starts: int | np.ndarray, robot: RobotSize) -> np.ndarray:
    """Return the number (s,) of the region that the middle of a robot on each span can drive in; the largest is 0.

    It is -1 where the robot does not fit; on the spans `starts` it does.
    """
    fits = (cells.storey >= 0) & (cells.clearance_m >= robot.radius_m)
    fits[starts] = True
    return components_of(len(fits), roomy_pairs_of(cells, robot), fits)


def covered(cells: FloorSpans, pairs: np.ndarray, middles: np.ndarray, robot: RobotSize) -> np.ndarray:
    """Return which spans (s,) a robot's disc covers whose middle is on any of some spans (s,)."""
    reached = middles
    usable = cells.storey >= 0
    kept = pairs[usable[pairs].all(axis=1)]
    for _ in range(int(np.ceil(robot.radius_m / cells.cell_m))):
        one, other = reached[kept].T
        reached = reached.copy()
        reached[kept[one, 1]] = True
        reached[kept[other, 0]] = True
    return reached
