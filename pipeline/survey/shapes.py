"""Shapes of a vector file, and their conversion to metres in the mine frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyproj
import shapely
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.errors import GeometryError, InputError
from pipeline.geometry.enclosure import as_polygons, enclose_workings
from pipeline.types import Georeference

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}
REACH_M = 10_000.0  # larger coordinates would lose precision in the world's text and its octree
_MAX_POINTS = 2_000_000
_MAX_BYTES = 64_000_000


@dataclass(frozen=True)
class Shapes:
    """Polygons and lines of a file, in its own coordinates. `unit` and `crs` are None if the file names none."""

    shapes: list[BaseGeometry]
    unit: str | None = None
    crs: str | None = None


def read_text_bytes(path: Path) -> bytes:
    """Return a text file's bytes.

    Raises
    ------
    InputError
        If the file cannot be read or is larger than 64 MB.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise InputError(f"{path}: {path.stat().st_size} bytes, the limit is {_MAX_BYTES}")
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error


def require_size(path: Path, points: int) -> None:
    """Refuse a file with too many points.

    Raises
    ------
    InputError
        If there are more than 2,000,000 points. The message names the file, the count and the limit.
    """
    if points > _MAX_POINTS:
        raise InputError(f"{path}: {points} points or more, the limit is {_MAX_POINTS}")


def locate(
    path: Path, content: Shapes, unit: str | None, origin: tuple[float, float] | None
) -> tuple[list[BaseGeometry], Georeference]:
    """Convert shapes to metres in the mine frame.

    Degrees are projected by a transverse Mercator about the middle of the shapes. Coordinates beyond 10 km are moved to
    an origin at the south-west corner, rounded to 10 m, unless `origin` is given.

    Returns
    -------
    list of shapely geometry, m, mine frame
    Georeference

    Raises
    ------
    InputError
        If a coordinate is not finite or more than 10 km from the origin, or the coordinate system is unknown.
    """
    shapes = [shapely.force_2d(shape) for shape in content.shapes if not shape.is_empty]
    if not shapes:
        raise InputError(f"{path}: holds no polygons and no lines")
    require_size(path, int(shapely.get_num_coordinates(shapes).sum()))
    if not np.isfinite(shapely.get_coordinates(shapes)).all():
        raise InputError(f"{path}: a coordinate is not finite")
    crs, projection = content.crs, None
    if crs is not None and unit is not None and _system(path, crs).is_geographic:
        crs = None  # a local grid in a format whose coordinate system is always in degrees
    unit_name = unit or content.unit or "m"
    metres = METRES[unit_name]
    if crs is not None and unit is None:
        system = _system(path, crs)
        if system.is_geographic:
            shapes, projection = _project(path, shapes, system)
            unit_name, metres = "m", 1.0
        elif system.axis_info:
            metres = float(system.axis_info[0].unit_conversion_factor)
            unit_name = str(system.axis_info[0].unit_name)
    mine_origin = origin or _origin(shapely.total_bounds(shapes).tolist(), metres)
    moved = [shapely.transform(shape, lambda p: (p - mine_origin) * metres) for shape in shapes]
    west, south, east, north = shapely.total_bounds(moved).tolist()
    if max(abs(west), abs(south), abs(east), abs(north)) > REACH_M:
        raise InputError(
            f"{path}: reaches from ({west:.0f}, {south:.0f}) to ({east:.0f}, {north:.0f}) m about survey.origin, "
            f"beyond {REACH_M:g} m; is survey.unit = {unit or unit_name} right?"
        )
    return moved, Georeference(unit_name, metres, mine_origin, crs, projection)


def _system(path: Path, crs: str) -> pyproj.CRS:
    try:
        return pyproj.CRS.from_user_input(crs)
    except pyproj.exceptions.CRSError as error:
        raise InputError(f"{path}: its coordinate system {crs[:80]!r} is unknown") from error


def _project(path: Path, shapes: list[BaseGeometry], system: pyproj.CRS) -> tuple[list[BaseGeometry], str]:
    west, south, east, north = shapely.total_bounds(shapes).tolist()
    if not (-180 <= west <= east <= 180 and -90 <= south <= north <= 90):
        raise InputError(
            f"{path}: coordinates from ({west:g}, {south:g}) to ({east:g}, {north:g}) are not degrees, but its "
            "coordinate system is (GeoJSON is always longitude and latitude); state survey.unit=m for a local grid"
        )
    projection = f"+proj=tmerc +lat_0={(south + north) / 2:.6f} +lon_0={(west + east) / 2:.6f} +ellps=WGS84 +units=m"
    to_local = pyproj.Transformer.from_crs(system, pyproj.CRS.from_proj4(projection), always_xy=True)
    return [shapely.transform(s, lambda p: np.column_stack(to_local.transform(*p.T))) for s in shapes], projection


def _origin(bounds: list[float], metres: float) -> tuple[float, float]:
    if max(map(abs, bounds)) * metres <= REACH_M:
        return 0.0, 0.0
    step = 10.0 / metres
    return math.floor(bounds[0] / step) * step, math.floor(bounds[1] / step) * step


def workings_of(
    path: Path, shapes: list[BaseGeometry], snap_m: float, seeds: list[tuple[float, float]]
) -> MultiPolygon:
    """Return the workings from shapes (m): their polygons, or the areas that their lines enclose.

    Raises
    ------
    InputError
        If there are no polygons and lines, or the lines enclose no area.
    """
    parts = [part for shape in shapes for part in _simple_parts(shape)]
    polygons = [part for part in parts if isinstance(part, Polygon)]
    lines = [part for part in parts if isinstance(part, LineString) and part.length > 0]
    if polygons and not lines:
        return as_polygons(shapely.union_all([shapely.make_valid(p) for p in polygons]))
    walls = [*lines, *(LineString(ring) for p in polygons for ring in (p.exterior, *p.interiors))]
    if not walls:
        raise InputError(f"{path}: holds no polygons and no lines")
    try:
        return enclose_workings(walls, snap_m, seeds)
    except (GeometryError, shapely.GEOSException) as error:
        raise InputError(f"{path}: {error}") from error


def _simple_parts(shape: BaseGeometry) -> list[BaseGeometry]:
    parts = shapely.get_parts(shape).tolist()
    return [p for part in parts for p in (_simple_parts(part) if hasattr(part, "geoms") else [part])]
