"""The floor spans of a volume: which of them a robot fits on, and the storeys that they make."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from minexplore.floors.volume_arrays import WAYS, FloorSpans, VolumeFacets
from minexplore.volume.standing import keys_of
from pipeline.volume.world.content import world_box
from pipeline.volume.world.reach import RobotSize, neighbours_of
from pipeline.volume.world.room import room_of
from pipeline.volume.world.spans import spans_of

_DIGITS = 6
_A_METRE = 1000  # steps of clearances, which are rounded down: they are most of the bytes of cells
_NEARLY = 0.01  # of a step, that rounding may take from a whole one


def cells_of(volume: VolumeFacets, cell_m: float, robot: RobotSize) -> FloorSpans:
    """Return the floor spans of a volume on a grid whose corner is a whole number of cells from the origin."""
    west, south, *_ = world_box(volume)
    origin = np.floor(np.array([west, south]) / cell_m) * cell_m
    spans = spans_of(volume.vertices, volume.faces, origin, cell_m)
    slope = _slopes(volume, spans.facet)
    flat = np.hypot(*slope.T) <= robot.steepest
    headroom = spans.roof_m - spans.floor_m
    bare = FloorSpans(
        spans.column.astype(np.int32),
        spans.row.astype(np.int32),
        spans.floor_m.round(_DIGITS),
        headroom.round(_DIGITS),
        np.zeros(len(headroom)),
        np.where(flat & (headroom >= robot.height_m), 0, -1).astype(np.int32),
        np.zeros((len(headroom), 3), np.float32),
        np.zeros((len(headroom), len(WAYS)), np.float32),
        origin,
        cell_m,
    )
    room = room_of(volume, bare, np.where(flat[:, None], slope, 0.0), robot)
    return replace(
        bare,
        clearance_m=_rounded_down(room.clearance_m),
        storey=storeys_of(bare.column, bare.row, bare.storey >= 0, neighbours_of(bare, robot)),
        aside_m=room.aside_m.round(_DIGITS).astype(np.float32),
        way_m=_rounded_down(room.way_m).astype(np.float32),
    )


def _rounded_down(clearances_m: np.ndarray) -> np.ndarray:
    """Return clearances, m, in whole millimetres that are not more."""
    found: np.ndarray = np.floor(clearances_m * _A_METRE + _NEARLY) / _A_METRE
    return found


def _slopes(volume: VolumeFacets, facets: np.ndarray) -> np.ndarray:
    """Return the slopes (s, 2) of facets (s,), rise over run to the east and the north; those of plumb ones are 1e9."""
    normal = volume.normals[facets]
    found: np.ndarray = normal[:, :2] / np.minimum(normal[:, 2:], -1e-9)
    return -found.clip(-1e9, 1e9)


def storeys_of(column: np.ndarray, row: np.ndarray, usable: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return the storey (s,) of each span, the largest first, and -1 of spans that are not usable.

    A storey is what spreads from its first span to neighbours, breadth first, once a column: a floor that passes over
    itself is cut where it would.

    Parameters
    ----------
    column, row : (s,) int
    usable : (s,) bool
    pairs : (n, 2) int
        Spans that are neighbours.
    """
    count = len(usable)
    key = np.unique(keys_of(column, row), return_inverse=True)[1].reshape(-1)
    left, first = usable.copy(), np.arange(count)  # `first` is the span that a storey begins at
    pairs = pairs[usable[pairs].all(axis=1)]
    while left.any():
        pairs = pairs[left[pairs].all(axis=1)]
        part = connected_components(coo_matrix((np.ones(len(pairs)), pairs.T), (count, count)), directed=False)[1]
        own = np.flatnonzero(left)
        begins = np.full(count, count)
        np.minimum.at(begins, part[own], own)
        first[own] = begins[part[own]]
        of_column, times = np.unique(part[own] * count + key[own], return_inverse=True, return_counts=True)[1:]
        over = np.unique(part[own[times[of_column.reshape(-1)] > 1]])  # these parts pass over themselves
        taken = ~np.isin(part, over)
        taken[_spread(begins[over], key, part, pairs)] = True
        left &= ~taken
    found, size = np.unique(first[usable], return_counts=True)
    rank = np.zeros(count, np.int64)
    rank[found[np.argsort(-size, kind="stable")]] = np.arange(len(found))
    storey: np.ndarray = np.where(usable, rank[first], -1).astype(np.int32)
    return storey


def _spread(starts: np.ndarray, key: np.ndarray, part: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return the spans that each start (k,) of a part of its own spreads to, in the order of a queue."""
    pairs = pairs[np.isin(part[pairs[:, 0]], part[starts])]
    ends, others = pairs.ravel(), pairs[:, ::-1].ravel()
    order = np.argsort(ends, kind="stable")
    others, begin = others[order], np.searchsorted(ends[order], np.arange(len(key) + 1))
    place = np.unique(part * (key.max(initial=0) + 1) + key, return_inverse=True)[1].reshape(-1)  # a column of a part
    is_taken = np.zeros(len(key), bool)
    is_taken[place[starts]] = True
    reached, edge = [starts], starts
    while len(edge):
        size = begin[edge + 1] - begin[edge]
        beside = others[np.repeat(begin[edge + 1] - np.cumsum(size), size) + np.arange(size.sum())]
        beside = beside[~is_taken[place[beside]]]
        edge = beside[np.sort(np.unique(place[beside], return_index=True)[1])]  # the first one of each column
        is_taken[place[edge]] = True
        reached.append(edge)
    return np.concatenate(reached)
