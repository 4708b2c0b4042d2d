"""Collision parts of the rock by the method that is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.errors import GeometryError
from pipeline.geometry.decompose import Decomposer, tile_rock
from pipeline.geometry.extrude import collect_parts, prism, section_footprint
from pipeline.geometry.partition import convex_partition
from pipeline.types import ConvexParts

Progress = Callable[[list[BaseGeometry]], Iterable[BaseGeometry]]


def exact_prisms(rock: Iterable[Polygon], height_m: float) -> ConvexParts:
    """Partition the rock exactly and stand each part up as a prism; see `convex_partition`."""
    return collect_parts([prism(part, height_m) for polygon in rock for part in convex_partition(polygon)])


def decomposed_hulls(
    rock: Iterable[Polygon], tiles: int, decompose: Decomposer, progress: Progress = iter
) -> ConvexParts:
    """Decompose the rock tile by tile into convex hulls.

    Parameters
    ----------
    rock : iterable of shapely.Polygon, m, mine frame
    tiles : int
    decompose : Decomposer
    progress : callable
        Wraps the list of tiles, as `tqdm.tqdm` does.

    Raises
    ------
    GeometryError
        If the decomposer returns nothing for a tile.
    """
    hulls = []
    for tile in progress(tile_rock(rock, tiles)):
        parts = decompose(tile)
        if not parts:
            raise GeometryError(f"decomposition: no hull for the tile at {tile.bounds}")
        hulls += parts
    return collect_parts(hulls)


def footprint_errors(parts: Iterable[np.ndarray], free: Polygon, world: Polygon) -> tuple[float, float]:
    """Measure how far collision parts, seen from above, depart from the rock.

    Parameters
    ----------
    parts : iterable of (n, 3) or (n, 2) float64, m, mine frame
        Vertices of convex parts.
    free : shapely.Polygon, m, mine frame
    world : shapely.Polygon, m, mine frame
        What rock and free space fill together.

    Returns
    -------
    intrusion_m2 : float
        Area of the free space that parts cover.
    missing_m2 : float
        Area of the rock that no part covers.
    """
    covered = shapely.union_all([section_footprint(part) for part in parts])
    return float(covered.intersection(free).area), float(world.difference(free).difference(covered).area)
