"""What a world costs beside how much rock it has: bytes, time and memory per square metre of rock.

A world of any size has a texture, a preview and a few files that do not grow with it. They are taken off first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely import LinearRing, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

# Of a drift of 15 x 1.6 m, whose world has 1.25 MB (0.48 MB of texture, 0.57 MB of preview, 0.05 MB of other files).
# MuJoCo needs more memory for a face of a small world: 188 MB for 160,000 faces, 11 of them for a texture of 1,024 px,
# and 2,217 MB for 2.5 million, on a line from 49 MB. The rest of the 60 is a texture more.
FIXED_BYTES, FIXED_LOAD_S, FIXED_LOAD_MB = 1_100_000, 0.05, 60.0
PARTS_PER_CORNER = 2  # a corner keeps two cuts at most; 22 maps and plans have 0.5 to 1.0 parts a corner


@dataclass(frozen=True)
class Size:
    """Rock of a mine, its walls and roof, m2, and bytes of its bundle per square metre."""

    rock_m2: float
    bytes: int


def rock_area_m2(free: BaseGeometry, height_m: float) -> float:
    """Return the area of walls and roof, m2, of workings of a height, m, as if they were level."""
    return float(free.length * height_m + free.area)


def measure_size(free: BaseGeometry, height_m: float, bundle_bytes: int) -> Size:
    """Return the area of rock and the bundle's bytes per square metre, without the `FIXED_BYTES` of every world."""
    rock_m2 = rock_area_m2(free, height_m)
    return Size(round(rock_m2, 1), round(max(bundle_bytes - FIXED_BYTES, 0) / rock_m2))


def load_per_m2(load_s: float, load_memory_mb: float, rock_m2: float) -> dict[str, float]:
    """Return the cost of loading per square metre of rock: seconds, and MB beyond the fixed ones."""
    seconds, megabytes = max(load_s - FIXED_LOAD_S, 0.0), max(load_memory_mb - FIXED_LOAD_MB, 0.0)
    return {"load_s": round(seconds / rock_m2, 9), "load_memory_mb": round(megabytes / rock_m2, 5)}


def parts_per_wall_m(parts: int, free: Polygon) -> float:
    """Return collision parts per metre of wall beyond those that exact parts may need.

    A convex part ends at a corner where the wall turns round the workings. Exact parts whose needless cuts are removed
    have `PARTS_PER_CORNER` for each such corner at most, and one for each pillar. A ragged or curved wall has more
    corners than a straight one as long. Tiles add parts that no corner asks for.

    References
    ----------
    Hertel & Mehlhorn 1983, FCT, doi:10.1007/3-540-12689-9_105
    """
    outline = orient(free)
    corners = sum(_cut_corners(ring) for ring in (outline.exterior, *outline.interiors))
    allowed = PARTS_PER_CORNER * corners + len(outline.interiors)
    return round(max(parts - allowed, 0) / float(free.length), 4)


def _cut_corners(ring: LinearRing) -> int:
    """Return at how many corners of a ring, workings on its left, the rock is not convex and must be cut."""
    places = shapely.get_coordinates(ring)[:-1]
    (ax, ay), (bx, by) = (places - np.roll(places, 1, axis=0)).T, (np.roll(places, -1, axis=0) - places).T
    return int((ax * by - ay * bx > 0).sum())
