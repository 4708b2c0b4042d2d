"""Whether collision walls enclose the workings: exact comparison of slices of the convex parts with the free space."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

_EXACT_M = 1e-4  # to which depths and widths are found; smaller ones are 0
_FAR_M = 1e3  # no rock reaches farther into the workings
_SEAM_M = 0.002  # edges of neighbouring parts may differ by the rounding of decimals in the MJCF


@dataclass(frozen=True)
class WallCover:
    """Worst values over all heights.

    Attributes
    ----------
    intrusion_mm, missing_mm : float
        How deep rock reaches into the free space, and the widest circle of rock that is missing.
    gap_mm : float
        The longest stretch of a wall without rock behind it.
    intrusion_m2, missing_m2 : float
        The areas of both in all of the mine.
    """

    intrusion_mm: float
    missing_mm: float
    gap_mm: float
    intrusion_m2: float
    missing_m2: float


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
    worst = [0.0] * 5
    for height in heights_m:
        rock = shapely.union_all([_slice(part, height) for part in all_parts])
        uncovered = free.boundary.intersection(world.buffer(-_SEAM_M)).difference(rock.buffer(_SEAM_M))
        gaps = (
            [piece.length for piece in shapely.get_parts(shapely.line_merge(uncovered))]
            if not uncovered.is_empty
            else [0.0]
        )
        inside, missing = rock.intersection(free), world.difference(free).difference(rock)
        errors = (
            1e3 * depth_m(inside, free),
            1e3 * width_m(missing),
            1e3 * max(gaps),
            inside.area,
            missing.area,
        )
        worst = [max(a, b) for a, b in zip(worst, errors, strict=True)]
    return WallCover(*(round(float(v), 6) for v in worst))


def depth_m(inside: BaseGeometry, free: Polygon) -> float:
    """Return how far from the walls, m, some area in the free space reaches."""
    return _largest(lambda size_m: bool(inside.intersects(free.buffer(-size_m))))


def width_m(area: BaseGeometry) -> float:
    """Return the diameter, m, of the largest circle in an area."""
    return 2 * _largest(lambda size_m: not area.buffer(-size_m).is_empty)


def _largest(fits: Callable[[float], bool]) -> float:
    """Return the largest size, m, that fits, at most 0.1 mm too large; 0 if 0.1 mm does not."""
    if not fits(_EXACT_M):
        return 0.0
    low, high = _EXACT_M, 2 * _EXACT_M
    while high < _FAR_M and fits(high):
        low, high = high, 2 * high
    while high - low > _EXACT_M:
        middle = (low + high) / 2
        low, high = (middle, high) if fits(middle) else (low, middle)
    return high


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
