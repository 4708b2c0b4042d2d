"""Coordinates of a stated system as a plan in east and north: degrees and stretched maps are projected."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyproj
import shapely
from shapely.geometry.base import BaseGeometry

from minesurveys.coordinates.ground import covers, ground_scale, is_true_to_scale
from minesurveys.coordinates.map_axes import axes_of, utm_zone
from minesurveys.errors import InputError

_WIDEST_DEG = 0.5  # of a mine in degrees: 55 km, five times what may be read
_WGS84 = (6_378_137.0, 298.257)  # semi-axis, m, and inverse flattening; GRS 80 differs by 0.1 mm


def is_projected(shapes: list[BaseGeometry], system: pyproj.CRS) -> bool:
    """Return whether shapes in a system are projected to get a plan in metres: degrees, and a stretched map.

    Coordinates outside the system's area are those of a local grid, whatever the file says: they are not.
    """
    if system.is_geographic:
        return True
    if not system.is_projected:
        return False
    west, south, east, north = shapely.total_bounds(shapes).tolist()
    middle = (west + east) / 2, (south + north) / 2
    try:
        return covers(system, *middle) and not is_true_to_scale(ground_scale(system, *middle))
    except pyproj.exceptions.ProjError:
        return False


def project(path: Path, shapes: list[BaseGeometry], system: pyproj.CRS) -> tuple[list[BaseGeometry], str]:
    """Return shapes in metres by a transverse Mercator about their middle, on the system's own ellipsoid.

    Returns
    -------
    list of shapely geometry, m
    str
        The projection of longitude and latitude, as PROJ writes it.

    Raises
    ------
    InputError
        If the coordinates are no degrees, or further apart than a mine is wide.
    """
    if not system.is_geographic:
        try:
            to_degrees = pyproj.Transformer.from_crs(system, system.geodetic_crs, always_xy=True)
            shapes = [shapely.transform(s, lambda p: np.column_stack(to_degrees.transform(*p.T))) for s in shapes]
        except pyproj.exceptions.ProjError as error:
            raise InputError(
                f"{path}: its coordinates cannot be projected; --unit m reads them as a local grid"
            ) from error
        system = system.geodetic_crs or system
    shapes = turned(shapes, system)
    west, south, east, north = shapely.total_bounds(shapes).tolist()
    if not (-180 <= west <= east <= 360 and -90 <= south <= north <= 90):
        raise InputError(
            f"{path}: coordinates from ({west:g}, {south:g}) to ({east:g}, {north:g}) are not degrees, but its "
            "coordinate system is (GeoJSON is always longitude and latitude); --unit m reads a local grid"
        )
    if max(east - west, north - south) > _WIDEST_DEG:
        raise InputError(
            f"{path}: coordinates from ({west:g}, {south:g}) to ({east:g}, {north:g}) would be degrees by its "
            f"coordinate system, and a mine is not {max(east - west, north - south):g} deg wide; --unit m reads a "
            "local grid"
        )
    middle = f"+lat_0={(south + north) / 2:.6f} +lon_0={(west + east) / 2:.6f}"
    projection = f"+proj=tmerc {middle} {_ellipsoid(system)} +units=m"
    to_local = pyproj.Proj(projection)
    return [shapely.transform(s, lambda p: np.column_stack(to_local(*p.T))) for s in shapes], projection


def turned(shapes: list[BaseGeometry], system: pyproj.CRS) -> list[BaseGeometry]:
    """Return shapes with x east and y north, in the plan's unit or in degrees."""
    axes = axes_of(system)
    if axes.ways == ((1.0, 0.0), (0.0, 1.0)):
        return shapes
    return [shapely.transform(shape, axes.plan_of) for shape in shapes]


def _ellipsoid(system: pyproj.CRS) -> str:
    """Return a system's ellipsoid, such as the Moon's sphere, as PROJ writes it."""
    body = system.ellipsoid
    if body is None or (body.semi_major_metre == _WGS84[0] and abs(body.inverse_flattening - _WGS84[1]) < 1e-3):
        return "+ellps=WGS84"
    if body.inverse_flattening == 0:
        return f"+R={body.semi_major_metre:.10g}"
    return f"+a={body.semi_major_metre:.10g} +rf={body.inverse_flattening:.12g}"


def require_lengths(path: Path, system: pyproj.CRS, place: np.ndarray, what: str, overrule: str = "") -> None:
    """Refuse a system of a scan or a surface in which lengths are not those on the ground: its points stay as they are.

    Parameters
    ----------
    path : Path
    system : pyproj.CRS
    place : (2 or 3,) float64
        A place in the file, which the advice is for.
    what : str
        What lies in the system, such as "points".
    overrule : str
        The end of the message, with the option that reads the file all the same.

    Raises
    ------
    InputError
        The message names the system in which the file is to be saved.
    """
    if system.is_geographic:
        raise InputError(
            f"{path}: its {what} are in degrees ({system.name}); transform them to {utm_zone(system, place)}{overrule}"
        )
    x, y = (float(value) for value in place[:2])
    try:
        along = ground_scale(system, x, y) if system.is_projected and covers(system, x, y) else (1.0, 1.0)
    except pyproj.exceptions.ProjError:
        return
    if not is_true_to_scale(along):
        raise InputError(
            f"{path}: its map ({system.name}) stretches lengths on the ground by {along[0]:.3f} and {along[1]:.3f}; "
            f"transform it to {utm_zone(system, place)}{overrule}"
        )
