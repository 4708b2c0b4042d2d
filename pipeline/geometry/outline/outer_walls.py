"""Outlines by their outer walls: the area inside them, islands included."""

from __future__ import annotations

import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry


def filled(outline: BaseGeometry) -> BaseGeometry:
    """Return the area inside the outer walls, islands included."""
    rings = [Polygon(part.exterior) for part in shapely.get_parts(outline)]
    return rings[0] if len(rings) == 1 else shapely.union_all(rings)


def count_islands(outline: BaseGeometry) -> int:
    """Return the number of islands."""
    return sum(len(part.interiors) for part in shapely.get_parts(outline))
