"""Whether collision walls enclose the workings: exact comparison of slices of the convex parts with the free space."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

_ROUND_M = 1e-4
_SEAM_M = 0.002  # edges of neighbouring parts may differ by the rounding of decimals in the MJCF


@dataclass(frozen=True)
class WallCover:
    """Worst values over all heights: rock in the free space, m2; missing rock, m2; the widest gap along a wall, m."""

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
        The workings, and the box that rock and workings fill together.
    heights_m : iterable of float
        Heights of the slices.
    """
    all_parts = list(parts)
    worst = [0.0, 0.0, 0.0]
    for height in heights_m:
        rock = shapely.union_all([_slice(part, height) for part in all_parts])
        uncovered = free.boundary.intersection(world.buffer(-_SEAM_M)).difference(rock.buffer(_SEAM_M))
        gaps = (
            [piece.length for piece in shapely.get_parts(shapely.line_merge(uncovered))]
            if not uncovered.is_empty
            else [0.0]
        )
        errors = (rock.intersection(free).area, world.difference(free).difference(rock).area, max(gaps))
        worst = [max(a, b) for a, b in zip(worst, errors, strict=True)]
    return WallCover(*(round(float(v), 6) for v in worst))


def _slice(part: np.ndarray, height_m: float) -> BaseGeometry:
    """Return the horizontal slice of a convex body: the hull of the crossings of all segments between its vertices."""
    below, above = part[part[:, 2] <= height_m], part[part[:, 2] > height_m]
    if not len(below) or not len(above):
        return Polygon()
    rise = (height_m - below[:, None, 2]) / (above[None, :, 2] - below[:, None, 2])
    crossing = below[:, None, :2] + rise[..., None] * (above[None, :, :2] - below[:, None, :2])
    return shapely.convex_hull(shapely.multipoints(crossing.reshape(-1, 2)))


def open_area_m2(slabs: Iterable[tuple[float, float, float, float]], free: Polygon) -> float:
    """Return the area of free space, m2, that no slab covers in plan; slabs are (west, south, east, north), m."""
    return round(float(free.difference(shapely.union_all([shapely.box(*slab) for slab in slabs])).area), 6)
