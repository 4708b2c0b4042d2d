"""Which floors of a volume a robot reaches from the spawn, by slope, steps, width and headroom."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from minexplore.floors.volume_arrays import WAYS, FloorSpans
from minexplore.physics.robot_kind import Robot

_STEEPEST = 0.364  # rise over run, as of the legs that are flat enough to drive on
_STEP_M = 0.05  # a castor's radius


class ColumnFloors(Protocol):
    """What of floor spans says which are neighbours; see `FloorSpans`."""

    @property
    def column(self) -> np.ndarray:
        """Return the columns (s,)."""

    @property
    def row(self) -> np.ndarray:
        """Return the rows (s,)."""

    @property
    def floor_m(self) -> np.ndarray:
        """Return the floors' heights (s,) m."""

    @property
    def headroom_m(self) -> np.ndarray:
        """Return the free heights (s,) m."""

    @property
    def cell_m(self) -> float:
        """Return the side of a column, m."""


def standing_spans(spans: FloorSpans, robot: Robot, anchor_m: np.ndarray) -> np.ndarray:
    """Return which spans (s,) a robot can stand on that are connected to the one nearest to a place (3,) m.

    Raises
    ------
    ValueError
        If the robot fits nowhere.
    """
    top_m = robot.top_m
    roomy = (spans.clearance_m >= robot.radius_m) & (spans.headroom_m >= top_m)
    fits = roomy & (spans.storey >= 0)
    if not fits.any():
        raise ValueError("no place where the robot fits")
    numbers = np.flatnonzero(fits)
    seed = int(numbers[np.square(spans.roomiest_m[numbers] - anchor_m).sum(axis=1).argmin()])
    pairs = driven_pairs(spans, robot)
    return connected(pairs[fits[pairs].all(axis=1)], len(fits), seed)


def driven_pairs(spans: FloorSpans, robot: Robot) -> np.ndarray:
    """Return the pairs (n, 2) of spans beside each other, also at a corner, between which a robot drives."""
    return wide_pairs(spans, _STEEPEST, _STEP_M, robot.top_m, robot.radius_m)


def wide_pairs(spans: FloorSpans, steepest: float, step_m: float, height_m: float, radius_m: float) -> np.ndarray:
    """Return the pairs (n, 2) of spans beside each other, also at a corner, between which a disc has room.

    The other parameters are those of `neighbours`.
    """
    found = [np.zeros((0, 2), np.int64)]
    for number in range(len(WAYS)):
        pairs = neighbours(spans, steepest, step_m, height_m, WAYS[number : number + 1])
        found.append(pairs[spans.way_m[pairs[:, 0], number] >= radius_m])
    return np.concatenate(found)


def connected(pairs: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Return which of so many spans (count,) pairs (n, 2) of them join to one."""
    both = np.concatenate([pairs, pairs[:, ::-1]])
    both = both[np.argsort(both[:, 0], kind="stable")]
    starts = np.searchsorted(both[:, 0], np.arange(count + 1))
    found, edge = np.zeros(count, bool), np.array([seed])
    while len(edge):  # all spans that are one step farther at a time
        found[edge] = True
        own = starts[edge + 1] - starts[edge]
        at = np.repeat(starts[edge] - np.cumsum(own) + own, own) + np.arange(own.sum())
        beside = np.unique(both[at, 1])
        edge = beside[~found[beside]]
    return found


def neighbours(
    spans: ColumnFloors,
    steepest: float,
    step_m: float,
    height_m: float,
    ways: Sequence[tuple[int, int]] = WAYS[:2],
) -> np.ndarray:
    """Return the pairs (n, 2) of spans in columns beside each other whose floors a robot climbs.

    Parameters
    ----------
    spans : ColumnFloors
    steepest : float
        Rise over run of the floors.
    step_m : float
        By which their heights may differ besides.
    height_m : float
        Of the robot, which must fit under both roofs on the higher of the two floors.
    ways : sequence of (int, int)
        Columns and rows from the first to the second span; by default to the east and the north.
    """
    key = keys_of(spans.column, spans.row)
    order = np.argsort(key, kind="stable")
    found, first, count = np.unique(key[order], return_index=True, return_counts=True)
    top_m = spans.floor_m + spans.headroom_m
    pairs = [np.zeros((0, 2), np.int64)]
    for east, north in ways:
        rise_m = steepest * spans.cell_m * math.hypot(east, north) + step_m
        beside = keys_of(spans.column + east, spans.row + north)
        at = np.minimum(np.searchsorted(found, beside), len(found) - 1)
        meets = found[at] == beside
        for k in range(int(count.max(initial=0))):
            one = np.flatnonzero(meets & (count[at] > k))
            other = order[first[at[one]] + k]
            over = np.maximum(spans.floor_m[one], spans.floor_m[other])
            near = np.abs(spans.floor_m[one] - spans.floor_m[other]) <= rise_m
            near &= np.minimum(top_m[one], top_m[other]) - over >= height_m
            pairs.append(np.column_stack([one[near], other[near]]))
    return np.concatenate(pairs)


def keys_of(column: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Return one number for each column; it is of columns within 2^30 cells of the origin."""
    found: np.ndarray = (column.astype(np.int64) << 32) + row.astype(np.int64)
    return found
