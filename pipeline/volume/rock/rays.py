"""Rays into the rock behind polygons: what they hit is in a part, before the part is tried in full."""

from __future__ import annotations

import numpy as np

from pipeline.geometry.facets.inside import Inside
from pipeline.volume.rock.shapes import Polygons, halving_planes, shaped

_SHARE = 0.95  # of the way from a polygon's middle to its corners and edges: where rays go
_DEEP_M = 0.03  # of a part, at least: rays hit next to nothing in thinner ones
_INSIDE_M = 2e-4  # of what is hit, from the faces of a part: rays have 32 bits, 0.03 mm at 500 m


def blocked(inside: Inside, polygons: Polygons, kind: str, depth_m: float) -> np.ndarray:
    """Return behind which polygons (n,) a part that is `moved` or `cut` so deep has a facet in it, as rays find.

    They go from the polygon to its moved copy, and across between the two. The others are to be tried in full, and
    so are all thin ones. `inside` is that of the free space.
    """
    if kind not in ("moved", "cut") or depth_m < _DEEP_M:
        return np.zeros(len(polygons), bool)
    found = np.zeros(len(polygons), bool)
    count = polygons.corners.shape[1]
    corners = shaped(polygons, "moved", depth_m).corners
    start, end = _spread(corners[:, :count]), _spread(corners[:, count:])
    half = (start + end) / 2
    start = np.concatenate([start, np.repeat(half[:, :1], half.shape[1] - 1, axis=1)], axis=1)
    way = np.concatenate([end, half[:, 1:]], axis=1) - start
    start += _INSIDE_M * way / np.maximum(np.linalg.norm(way, axis=2, keepdims=True), 1e-9)
    share = inside.ways_m(start, way)
    body, ray = np.nonzero(share < 1)
    some, row = np.unique(body, return_inverse=True)
    hit = start[body, ray] + share[body, ray, None] * way[body, ray]
    found[body[_depth_in(polygons.some(some), row, hit, kind, depth_m) > _INSIDE_M]] = True
    return found


def _depth_in(polygons: Polygons, number: np.ndarray, places: np.ndarray, kind: str, depth_m: float) -> np.ndarray:
    """Return how far (p,) m places (p, 3) are behind all faces of a shape of the polygon with a number (p,)."""
    moved = shaped(polygons, "moved", depth_m)
    reach = (moved.directions @ moved.corners.transpose(0, 2, 1)).max(axis=2)
    found: np.ndarray = (reach[number] - (moved.directions[number] @ places[:, :, None])[:, :, 0]).min(axis=1)
    if kind == "cut":
        ways, offsets = halving_planes(polygons)
        found = np.minimum(found, ((ways[number] @ places[:, :, None])[:, :, 0] - offsets[number]).min(axis=1))
    return found


def _spread(corners: np.ndarray) -> np.ndarray:
    """Return the middle of polygons' corners (n, k, 3), and places near their corners and edges (n, 1 + 2 k, 3)."""
    middle = corners.mean(axis=1, keepdims=True)
    away = corners - middle
    edges = (away + np.roll(away, -1, axis=1)) / 2
    return np.concatenate([middle, *(middle + _SHARE * way for way in (away, edges))], axis=1)
