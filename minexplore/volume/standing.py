"""Which floors of a volume a robot reaches from the spawn, by slope, steps, width and headroom."""

from __future__ import annotations

import numpy as np

from minexplore.floors.volume_arrays import FloorSpans
from minexplore.physics.robot import RobotParams

_STEEPEST = 0.364  # rise over run, as of the legs that are flat enough to drive on
_STEP_M = 0.05  # a castor's radius
_NEXT = ((1, 0), (0, 1))  # a robot goes on to the next cell east or north, and back


def standing_spans(spans: FloorSpans, robot: RobotParams, anchor_m: np.ndarray) -> np.ndarray:
    """Return which spans (s,) a robot can stand on that are connected to the one nearest to a place (3,) m.

    Raises
    ------
    ValueError
        If the robot fits nowhere.
    """
    top_m = robot.sensor_height_m + robot.scanner_height_m / 2
    roomy = (spans.clearance_m >= robot.radius_m) & (spans.headroom_m >= top_m)
    fits = np.flatnonzero(roomy & (spans.storey >= 0))
    if not len(fits):
        raise ValueError("no place where the robot fits")
    seed = int(np.square(spans.places_m[fits] - anchor_m).sum(axis=1).argmin())
    first, second = _beside(spans, fits, top_m)
    order = np.argsort(np.concatenate([first, second]), kind="stable")
    neighbour = np.concatenate([second, first])[order]
    starts = np.searchsorted(np.concatenate([first, second])[order], np.arange(len(fits) + 1))
    reached, edge = np.zeros(len(fits), bool), np.array([seed])
    while len(edge):  # all spans that are one step farther at a time
        reached[edge] = True
        count = starts[edge + 1] - starts[edge]
        at = np.repeat(starts[edge] - np.cumsum(count) + count, count) + np.arange(count.sum())
        found = np.unique(neighbour[at])
        edge = found[~reached[found]]
    standing = np.zeros(len(spans.storey), bool)
    standing[fits[reached]] = True
    return standing


def _beside(spans: FloorSpans, fits: np.ndarray, top_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs, as numbers in `fits`, between which a robot of some height can drive."""
    column, row, floor = spans.column[fits].astype(np.int64), spans.row[fits].astype(np.int64), spans.floor_m[fits]
    roof = floor + spans.headroom_m[fits]
    wide = int(column.max(initial=0)) + 2
    key = row * wide + column
    order = np.argsort(key, kind="stable")
    keys = key[order]
    rise_m = _STEEPEST * spans.cell_m + _STEP_M
    pairs = [(np.zeros(0, int), np.zeros(0, int))]
    for east, north in _NEXT:
        wanted = key + north * wide + east
        start, end = (np.searchsorted(keys, wanted, side=side) for side in ("left", "right"))
        for k in range(int((end - start).max(initial=0))):
            one = np.flatnonzero(start + k < end)
            two = order[start[one] + k]
            near = np.abs(floor[two] - floor[one]) <= rise_m
            near &= np.minimum(roof[one], roof[two]) - np.maximum(floor[one], floor[two]) >= top_m
            pairs.append((one[near], two[near]))
    first, second = (np.concatenate(column) for column in zip(*pairs, strict=True))
    return first, second
