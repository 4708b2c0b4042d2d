"""Whether collision walls enclose the workings: slices of the convex parts against the free space, exactly, in plan."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

_SEAM_M = 0.002  # neighbours' edges may differ by rounding of the MJCF's decimals


@dataclass(frozen=True)
class WallCover:
    """Of the worst height: rock in the free space and rock left open, m2, and the widest gap along a wall, m."""

    intrusion_m2: float
    missing_m2: float
    widest_gap_m: float


def cover_walls(parts: Iterable[np.ndarray], free: Polygon, world: Polygon, heights_m: Iterable[float]) -> WallCover:
    """Compare slices of convex parts with the rock that the plan leaves.

    Parameters
    ----------
    parts : iterable of (n, 3) float64, m, mine frame
        Vertices of convex parts, in any order.
    free, world : shapely.Polygon, m, mine frame
        The workings, and what rock and workings fill together.
    heights_m : iterable of float
        Heights of the slices.
    """
    everything = list(parts)
    worst = [0.0, 0.0, 0.0]
    for height in heights_m:
        rock = shapely.union_all([_slice(part, height) for part in everything])
        bare = free.boundary.intersection(world.buffer(-_SEAM_M)).difference(rock.buffer(_SEAM_M))
        gaps = [piece.length for piece in shapely.get_parts(shapely.line_merge(bare))] if not bare.is_empty else [0.0]
        found = (rock.intersection(free).area, world.difference(free).difference(rock).area, max(gaps))
        worst = [max(a, b) for a, b in zip(worst, found, strict=True)]
    return WallCover(*(round(float(v), 6) for v in worst))


def _slice(part: np.ndarray, height_m: float) -> BaseGeometry:
    """Return the level slice of a convex body: what all segments between vertices below and above it pass through."""
    below, above = part[part[:, 2] <= height_m], part[part[:, 2] > height_m]
    if not len(below) or not len(above):
        return Polygon()
    rise = (height_m - below[:, None, 2]) / (above[None, :, 2] - below[:, None, 2])
    crossing = below[:, None, :2] + rise[..., None] * (above[None, :, :2] - below[:, None, :2])
    return shapely.convex_hull(shapely.multipoints(crossing.reshape(-1, 2)))


def open_area_m2(slabs: Iterable[tuple[float, float, float, float]], free: Polygon) -> float:
    """Return the free space's area, m2, that no slab (west, south, east, north) m lies under or over."""
    return round(float(free.difference(shapely.union_all([shapely.box(*slab) for slab in slabs])).area), 6)
