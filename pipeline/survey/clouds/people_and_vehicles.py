"""Things that stand in the workings: people and vehicles, which are parts of the scan and not of the rock."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from pipeline.survey.clouds.normals import PointPlanes, SidedPoints
from pipeline.survey.clouds.thinned import ThinnedCloud
from pipeline.survey.clouds.voxels import cells_at, components_of, is_in, keys_of

_UP = 0.7  # of a normal's length upwards: a floor, or the top of a thing
_LEAST_M, _MOST_M = 0.25, 6.0  # a thing's height
_MOST_M2 = 60.0  # in plan: a large truck
_LEAST_ROWS = 5
_REACH = 2  # voxels: one without a point, as between a scanner's lines, does not part a thing
_SURROUNDED = 0.6  # of the places about a thing are free
_ABOUT = 3  # voxels from a thing to where free space is looked for: walls are thickened by one
_RING_M = 1.0  # beside a thing, where its floor is measured
_ON_FLOOR_M = 0.12
_BESIDE_M = 0.15


@dataclass(frozen=True)
class Thing:
    """What stands free: the middle of its foot, m, its length and width in plan and its height, m, and its points."""

    middle_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    points: int


def find_things(
    cloud: ThinnedCloud, planes: PointPlanes, sides: SidedPoints, free: np.ndarray, size_m: float
) -> tuple[list[Thing], np.ndarray]:
    """Return what stands free on the floor, and the rows of the cloud that are part of it.

    What is left of the points without level ones, of floors and roofs, falls into pieces; a thing is a piece with free
    space about it and over it. Points on the floor, which is a plane through the points about the thing, are kept.
    """
    up = np.zeros(len(cloud), bool)
    up[sides.rows[sides.normals[:, 2] > _UP]] = True
    upright = np.flatnonzero(np.abs(planes.normals[:, 2]) <= _UP)
    found: list[Thing] = []
    rows = np.zeros(0, np.int64)
    for some in _pieces(cloud, upright, size_m):
        thing, taken = _thing_of(cloud, some, up, free, size_m)
        if thing is not None:
            found.append(thing)
            rows = np.union1d(rows, taken)
    return found, rows


def _pieces(cloud: ThinnedCloud, own: np.ndarray, size_m: float) -> list[np.ndarray]:
    """Return the rows of each piece of some points."""
    keys, number = np.unique(keys_of(cells_at(cloud.points_m[own], size_m)), return_inverse=True)
    part = components_of(keys, _REACH)[number.reshape(-1)]
    return np.split(own[np.argsort(part, kind="stable")], np.cumsum(np.bincount(part))[:-1])


def _thing_of(
    cloud: ThinnedCloud, some: np.ndarray, up: np.ndarray, free: np.ndarray, size_m: float
) -> tuple[Thing | None, np.ndarray]:
    """Return the thing that a piece is, and its rows, or None if it does not stand free."""
    if len(some) < _LEAST_ROWS:
        return None, some[:0]
    points = cloud.points_m[some]
    low, high = points.min(axis=0), points.max(axis=0)
    if not _LEAST_M <= high[2] - low[2] <= _MOST_M:
        return None, some[:0]
    outline = shapely.MultiPoint(points[:, :2]).convex_hull
    if outline.area > _MOST_M2 or not _stands_free(outline, low[2], high[2], free, size_m):
        return None, some[:0]
    taken = _rows_of(outline.buffer(_BESIDE_M), low[2], high[2], cloud, up)
    box = shapely.oriented_envelope(outline.buffer(0.01))
    a, b = sorted(np.linalg.norm(np.diff(shapely.get_coordinates(box)[:3], axis=0), axis=1).tolist())
    x, y = outline.centroid.coords[0]
    size = (b, a, float(high[2] - low[2]))
    return Thing((float(x), float(y), float(low[2])), size, int(cloud.count[taken].sum())), taken


def _stands_free(outline: shapely.Geometry, low: float, high: float, free: np.ndarray, size_m: float) -> bool:
    """Return whether free voxels lie about a thing at most heights, and over it."""
    steps = size_m * np.arange(2, 2 + _ABOUT)
    levels = np.arange(low + 3 * size_m, max(high, low + 4 * size_m), size_m)
    edge = shapely.get_coordinates(shapely.segmentize(outline.buffer(size_m).exterior, size_m))
    away = edge - shapely.get_coordinates(outline.centroid)
    away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
    beside = edge + steps[:, None, None] * away
    places = np.concatenate([np.dstack([beside, np.full(beside.shape[:2], z)])[:, None] for z in levels], axis=1)
    over = np.array([np.column_stack([edge, np.full(len(edge), high + step)]) for step in steps])
    shares = [
        is_in(keys_of(cells_at(at.reshape(-1, 3), size_m)), free).reshape(len(steps), -1).any(axis=0).mean()
        for at in (places, over)
    ]
    return bool(min(shares) >= _SURROUNDED)


def _rows_of(outline: shapely.Geometry, low: float, high: float, cloud: ThinnedCloud, up: np.ndarray) -> np.ndarray:
    """Return the rows of the points of a thing: within its outline, from its foot to its top, and over the floor."""
    xmin, ymin, xmax, ymax = outline.buffer(_RING_M).bounds
    x, y, z = cloud.points_m.T
    near = np.flatnonzero((x >= xmin) & (x <= xmax) & (y >= ymin) & (y <= ymax) & (z > low - 1) & (z < high + 0.3))
    points = cloud.points_m[near]
    inside = shapely.contains_xy(outline, points[:, 0], points[:, 1])
    floor = points[~inside & up[near] & (points[:, 2] < (low + high) / 2)]
    foot = np.full(len(points), low + _ON_FLOOR_M)
    if len(floor) > 3:
        plane = np.linalg.lstsq(np.column_stack([floor[:, :2], np.ones(len(floor))]), floor[:, 2], rcond=None)[0]
        foot = points[:, :2] @ plane[:2] + plane[2] + _ON_FLOOR_M
    return near[inside & (points[:, 2] > foot)]
