"""The place where robots start, in the plan of a mine."""

from __future__ import annotations

import numpy as np
import shapely

from minesurveys.errors import InputError
from minesurveys.frames import Heights

_NEAR_M = 20.0  # of a start from the line of its drift; the widest drifts and rooms are 40 m wide


def start_in_plan(start_m: tuple[float, ...], heights: Heights | None) -> tuple[float, float]:
    """Return a start (easting, northing[, elevation]) m, mine frame, as a place (x, y) m of the plan.

    With an elevation the start is on the drift with the nearest one.

    Raises
    ------
    InputError
        If an elevation is stated and the floor's lines are not known or not near.
    """
    east, north, *elevation = start_m
    if not elevation:
        return east, north
    if heights is None or not heights.lines:
        raise InputError(f"survey.entrance_m = {list(start_m)}: an elevation needs a survey whose drifts have them")
    z = elevation[0] - heights.datum_m
    found = []
    place = shapely.Point(east, north)
    for drawn in (shapely.LineString(line) for line in heights.lines if len(line) > 1):
        over = drawn.interpolate(drawn.project(place)).z - z
        found.append(float(np.hypot(drawn.distance(place), over)))
    if min(found, default=np.inf) > _NEAR_M:
        raise InputError(f"survey.entrance_m = {list(start_m)}: no drift within {_NEAR_M:g} m")
    return east, north
