"""The workings that the polygons or the walls of a drawing enclose."""

from __future__ import annotations

from pathlib import Path

import shapely
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from minesurveys.errors import GeometryError, InputError
from pipeline.geometry.outline.enclosure import as_polygons, enclose_workings


def workings_of(
    path: Path, shapes: list[BaseGeometry], snap_m: float, seeds: list[tuple[float, float]]
) -> MultiPolygon:
    """Return the workings from shapes (m): their polygons, or the areas that their lines enclose.

    Raises
    ------
    InputError
        If there are no polygons and lines, or the lines enclose no area.
    """
    parts = [part for shape in shapes for part in shapely.get_parts(shape)]
    polygons = [part for part in parts if isinstance(part, Polygon)]
    lines = [part for part in parts if isinstance(part, LineString) and part.length > 0]
    if polygons and not lines:
        try:
            return as_polygons(shapely.union_all([shapely.make_valid(p) for p in polygons]))
        except shapely.GEOSException as error:
            raise InputError(
                f"{path}: its polygons are too tangled to be united; mend them in the program that drew them"
            ) from error
    walls = [*lines, *(LineString(ring) for p in polygons for ring in (p.exterior, *p.interiors))]
    if not walls:
        raise InputError(f"{path}: holds no polygons and no lines")
    try:
        return enclose_workings(walls, snap_m, seeds)
    except GeometryError as error:
        raise InputError(f"{path}: {error}") from error
    except shapely.GEOSException as error:
        raise InputError(f"{path}: its lines are too tangled to enclose an area; --layer chooses layers") from error
