"""Collision parts of the rock, by exact partition or by convex decomposition of tiles."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import shapely
from scipy.spatial import ConvexHull, QhullError
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.errors import GeometryError
from pipeline.geometry.rock.extrude import collect_parts, prism
from pipeline.geometry.rock.partition import convex_partition
from pipeline.progress import counted
from pipeline.types import ConvexParts, Points3

Decomposer = Callable[[BaseGeometry], list[Points3]]
_FLAT_M3 = 1e-6


def exact_prisms(rock: Iterable[Polygon], height_m: float) -> ConvexParts:
    """Partition the rock exactly and extrude each part into a prism; see `convex_partition`."""
    return collect_parts([prism(part, height_m) for polygon in rock for part in convex_partition(polygon)])


def tile_rock(rock: Iterable[Polygon], tiles: int) -> list[BaseGeometry]:
    """Cut the rock by a regular grid into the given number of tiles, as square as possible.

    Parameters
    ----------
    rock : iterable of shapely.Polygon, m, mine frame
    tiles : int
        Cells of the grid. A drift may divide a tile into several pieces.

    Returns
    -------
    list of shapely geometries, m
        One polygon or multipolygon for each tile with rock, row by row from the south-west.
    """
    whole = shapely.union_all(list(rock))
    west, south, east, north = whole.bounds
    shapes = [(tiles // rows, rows) for rows in range(1, tiles + 1) if tiles % rows == 0]
    cols, rows = min(shapes, key=lambda s: abs(np.log((east - west) / s[0] / ((north - south) / s[1]))))
    xs, ys = np.linspace(west, east, cols + 1), np.linspace(south, north, rows + 1)
    cells: list[BaseGeometry] = []
    for j in range(rows):
        for i in range(cols):
            cut = whole.intersection(shapely.box(xs[i], ys[j], xs[i + 1], ys[j + 1]))
            solid = shapely.union_all([p for p in shapely.get_parts(cut) if isinstance(p, Polygon)])
            if not solid.is_empty:
                cells.append(solid)
    return cells


def decomposed_hulls(rock: Iterable[Polygon], tiles: int, decompose: Decomposer) -> ConvexParts:
    """Decompose the rock tile by tile into convex hulls.

    Parameters
    ----------
    rock : iterable of shapely.Polygon, m, mine frame
    tiles : int
    decompose : Decomposer

    Raises
    ------
    GeometryError
        If the decomposer returns nothing for a tile.
    """
    hulls = []
    for tile in counted(tile_rock(rock, tiles), "decomposition", "tiles"):
        parts = decompose(tile)
        if not parts:
            raise GeometryError(f"decomposition: no hull for the tile at {tile.bounds}")
        hulls += [part for part in parts if _has_volume(part)]
    return collect_parts(hulls)


def _has_volume(hull: Points3) -> bool:
    """Return whether a hull has volume. V-HACD sometimes returns a flat hull, which physics engines refuse."""
    try:
        return ConvexHull(hull).volume > _FLAT_M3
    except QhullError:
        return False
