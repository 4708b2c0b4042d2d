"""The floor spans of a volume: which of them a robot fits on, and the storeys that they make."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from minexplore.floors.volume_arrays import FloorSpans, VolumeFacets
from pipeline.geometry.ray_scene import ray_scene
from pipeline.volume.world.content import world_box
from pipeline.volume.world.reach import RobotSize, neighbours_of
from pipeline.volume.world.spans import spans_of

_NO_WALL_M = 1e3  # clearance where there is no wall at all
_DIGITS = 6


def cells_of(volume: VolumeFacets, cell_m: float, robot: RobotSize) -> FloorSpans:
    """Return the floor spans of a volume on a grid whose corner is a whole number of cells from the origin."""
    west, south, *_ = world_box(volume)
    origin = np.floor(np.array([west, south]) / cell_m) * cell_m
    spans = spans_of(volume.vertices, volume.faces, origin, cell_m)
    flat = _flat_facets(volume, robot.steepest)
    headroom = spans.roof_m - spans.floor_m
    bare = FloorSpans(
        spans.column.astype(np.int32),
        spans.row.astype(np.int32),
        spans.floor_m.round(_DIGITS),
        headroom.round(_DIGITS),
        np.zeros(len(headroom)),
        np.where(flat[spans.facet] & (headroom >= robot.height_m), 0, -1).astype(np.int32),
        origin,
        cell_m,
    )
    clearance = _clearance(volume, flat, bare.places_m, np.minimum(robot.height_m, headroom) / 2)
    storey = _storeys(bare, neighbours_of(bare, robot))
    return replace(bare, clearance_m=clearance.round(_DIGITS), storey=storey)


def _flat_facets(volume: VolumeFacets, steepest: float) -> np.ndarray:
    """Return which facets (f,) are floors no steeper than a rise over run."""
    normal = volume.normals
    found: np.ndarray = np.hypot(normal[:, 0], normal[:, 1]) <= -normal[:, 2] * steepest
    return found & (normal[:, 2] < 0)


def _clearance(volume: VolumeFacets, flat: np.ndarray, places: np.ndarray, above_m: np.ndarray) -> np.ndarray:
    """Return the distance (s,) m of places, so far above the floor, from all that is no flat floor."""
    if flat.all():
        return np.full(len(places), _NO_WALL_M)
    middle = volume.vertices.mean(axis=0)  # distances are measured in 32 bits
    scene = ray_scene(volume.vertices - middle, volume.faces[~flat], 1)
    seen = places - middle + above_m[:, None] * [0, 0, 1.0]
    found: np.ndarray = scene.compute_distance(seen.astype(np.float32), nthreads=1).numpy()
    return found.astype(np.float64)


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
