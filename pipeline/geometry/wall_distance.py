"""Distances of places from walls."""

from __future__ import annotations

import numpy as np
import shapely
from jaxtyping import Float64
from shapely.geometry.base import BaseGeometry

from pipeline.geometry.nearest_edges import nearest_edges
from pipeline.geometry.polyline import points_along
from pipeline.types import Points2

_SPACING_M = 0.05


def distances_to_walls(walls: BaseGeometry, places: np.ndarray) -> Float64[np.ndarray, " n"]:
    """Return how far each place is from the nearest wall, whichever side of it the place is on.

    The walls are searched edge by edge in a tree. A search in the whole boundary takes sixty times as long for a traced
    outline of sixty thousand vertices.

    Parameters
    ----------
    walls : shapely geometry, m
        Polygons with any number of holes, whose boundary is meant, or lines.
    places : (n, 2) m

    Returns
    -------
    (n,) m
    """
    lines = walls if shapely.get_dimensions(walls) == 1 else walls.boundary
    rings = [shapely.get_coordinates(line) for line in shapely.get_parts(lines)]
    edges = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    return nearest_edges(edges, places).distance_m


def points_on_walls(workings: BaseGeometry) -> Points2:
    """Return points (n, 2) m every 5 cm along the walls of polygons."""
    rings = [ring for part in shapely.get_parts(workings) for ring in (part.exterior, *part.interiors)]
    return np.vstack([points_along(np.asarray(ring.coords)[:, :2], _SPACING_M) for ring in rings])


def largest_error_m(traced: BaseGeometry, built: BaseGeometry) -> float:
    """Return the largest distance, m, of either wall from the other, at points every 5 cm and at all vertices."""
    there, back = (
        distances_to_walls(b, np.vstack([points_on_walls(a), shapely.get_coordinates(a)]))
        for a, b in ((traced, built), (built, traced))
    )
    return float(max(there.max(), back.max()))
