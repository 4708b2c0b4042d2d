"""The floor spans of a volume: which of them a robot fits on, and the storeys that they make."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from minexplore.floors.volume_arrays import WAYS, FloorSpans, VolumeFacets
from pipeline.volume.world.content import world_box
from pipeline.volume.world.reach import RobotSize, neighbours_of
from pipeline.volume.world.room import room_of
from pipeline.volume.world.spans import spans_of

_DIGITS = 6


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
        clearance_m=room.clearance_m.round(_DIGITS),
        storey=_storeys(bare, neighbours_of(bare, robot)),
        aside_m=room.aside_m.round(_DIGITS).astype(np.float32),
        way_m=room.way_m.round(_DIGITS).astype(np.float32),
    )


def _slopes(volume: VolumeFacets, facets: np.ndarray) -> np.ndarray:
    """Return the slopes (s, 2) of facets (s,), rise over run to the east and the north; those of plumb ones are 1e9."""
    normal = volume.normals[facets]
    found: np.ndarray = normal[:, :2] / np.minimum(normal[:, 2:], -1e-9)
    return -found.clip(-1e9, 1e9)


def _storeys(cells: FloorSpans, pairs: np.ndarray) -> np.ndarray:
    """Return the storey of each span, the largest first; a floor that passes over itself is cut where it would."""
    usable = cells.storey >= 0
    key = np.unique(np.column_stack([cells.column, cells.row]), axis=0, return_inverse=True)[1].reshape(-1)
    beside = _adjacency(len(usable), pairs[usable[pairs].all(axis=1)])
    storey = np.full(len(usable), -1)
    count = 0
    for start in np.flatnonzero(usable).tolist():
        if storey[start] < 0:
            _spread(start, count, storey, key, beside)
            count += 1
    if not count:
        return storey.astype(np.int32)
    sizes = np.bincount(storey[usable], minlength=count)
    rank = np.empty(count, np.int64)
    rank[np.argsort(-sizes, kind="stable")] = np.arange(count)
    found: np.ndarray = np.where(usable, rank[storey], -1).astype(np.int32)
    return found


def _spread(start: int, number: int, storey: np.ndarray, key: np.ndarray, beside: list[list[int]]) -> None:
    """Give a storey's number to the spans about one that have none, once a column."""
    taken, queue = {int(key[start])}, deque([start])
    storey[start] = number
    while queue:
        for other in beside[queue.popleft()]:
            if storey[other] < 0 and int(key[other]) not in taken:
                taken.add(int(key[other]))
                storey[other] = number
                queue.append(other)


def _adjacency(count: int, pairs: np.ndarray) -> list[list[int]]:
    beside: list[list[int]] = [[] for _ in range(count)]
    for one, other in pairs.tolist():
        beside[one].append(other)
        beside[other].append(one)
    return beside
