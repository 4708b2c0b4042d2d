"""Notice coordinate systems whose unit is no metre on the ground, such as Web Mercator."""

from __future__ import annotations

import math

import numpy as np
import pyproj

_STEP_M = 100.0
_GROUND_ERROR = 0.003  # of a length; UTM zones and national grids stay within 0.001


def ground_scale(system: pyproj.CRS, east: float, north: float) -> tuple[float, float]:
    """Return how much longer lengths are in a projected system than on the ground, along its first and second axis.

    Parameters
    ----------
    system : pyproj.CRS
        Projected.
    east, north : float
        A place, in the system's unit.

    Returns
    -------
    (float, float)
        1 is true to scale. Web Mercator has about 1 / cos(latitude): 1.74 at latitude 55.

    Raises
    ------
    pyproj.exceptions.ProjError
        If the place is outside the projection.
    """
    step = _STEP_M / float(system.axis_info[0].unit_conversion_factor)
    geodetic = system.geodetic_crs or pyproj.CRS("EPSG:4326")
    to_degrees = pyproj.Transformer.from_crs(system, geodetic, always_xy=True)
    geod = system.get_geod() or pyproj.Geod(ellps="WGS84")
    found = to_degrees.transform([east, east + step, east], [north, north, north + step], errcheck=True)
    degrees = math.degrees(geodetic.axis_info[0].unit_conversion_factor)  # French maps have grads
    lon, lat = np.array(found) * degrees
    _, _, along = geod.inv([lon[0]] * 2, [lat[0]] * 2, lon[1:], lat[1:])
    return _STEP_M / float(along[0]), _STEP_M / float(along[1])


def is_true_to_scale(scales: tuple[float, float]) -> bool:
    """Return whether lengths are those on the ground to within 0.3 %."""
    return max(abs(scale - 1.0) for scale in scales) <= _GROUND_ERROR


def covers(system: pyproj.CRS, east: float, north: float) -> bool:
    """Return whether a place lies in the area that a system is made for; true if the system states none."""
    area = system.area_of_use
    if area is None:
        return True
    lon, lat = pyproj.Transformer.from_crs(system, "EPSG:4326", always_xy=True).transform(east, north, errcheck=True)
    return bool(area.south - 1 <= lat <= area.north + 1 and _within(lon, area.west, area.east))


def _within(lon: float, west: float, east: float) -> bool:
    span = east - west if east >= west else east - west + 360.0
    return (lon - west + 1.0) % 360.0 <= span + 2.0
