"""The angle between true north and the north of a coordinate system."""

from __future__ import annotations

import numpy as np
import pyproj

_NORTH_DEG = 1e-3  # a step to the north


def convergence_deg(system: pyproj.CRS, east: float, north: float) -> float:
    """Return the meridian convergence of a system, deg, positive where its north lies east of true north.

    True north is that of WGS84, as Therion has it: a step to the north, seen in the system.

    Raises
    ------
    pyproj.exceptions.ProjError
        If there is no way from the system to WGS84. The angle is nan or inf outside of the system.
    """
    to_degrees = pyproj.Transformer.from_crs(system, "EPSG:4326", always_xy=True)
    longitude, latitude = to_degrees.transform(east, north)
    ends = to_degrees.transform([longitude] * 2, [latitude, latitude + _NORTH_DEG], direction="INVERSE")
    return -float(np.degrees(np.arctan2(*(np.diff(values)[0] for values in ends))))
