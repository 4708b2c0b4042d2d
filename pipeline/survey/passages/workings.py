"""The workings of level legs in plan: each leg as wide as the survey has it, and bends that take nothing of it."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minesurveys.errors import InputError, first_few
from pipeline.survey.passages.bends import LegEnd, outer_sectors
from pipeline.survey.passages.legs import pack_legs
from pipeline.survey.passages.sections import sections_of
from pipeline.survey.passages.survey_leg import SurveyLeg
from pipeline.types import SurveyedLegs

_STEP_RAD = 0.1  # an arc is 1 mm off at 1 m
_OVERLAP_RAD = 1e-6
_SLIT_M2 = 1e-6


def build_workings(legs: list[SurveyLeg]) -> BaseGeometry:
    """Rebuild the workings in plan.

    Between neighbouring stations it is the quadrilateral through their sections (`sections_of`), at each station a disc
    whose radius is the smaller wall distance. On the outside of a bend whose legs have sections of their own, it is the
    sector between these: the wall goes round the station as far away as it was measured. So the way round a bend is as
    wide as its legs, and no measured wall is crossed.

    Returns
    -------
    shapely geometry, m, mine frame
        Several polygons where both wall distances of a station are zero.
    """
    shapes: list[BaseGeometry] = []
    places: dict[str, np.ndarray] = {}
    ends: dict[str, list[LegEnd]] = defaultdict(list)
    for leg in legs:
        across, _ = sections_of(leg.positions_m, leg.walls_m)
        for k, stations in enumerate(pairwise(leg.stations)):
            both, (near, far) = leg.positions_m[k : k + 2], leg.walls_m[k : k + 2]
            left, right = both + across[k] * [near[:1], far[:1]], both - across[k] * [near[1:], far[1:]]
            shapes.append(shapely.convex_hull(shapely.multipoints([left[0], left[1], right[1], right[0]])))
            places |= dict(zip(stations, both, strict=True))
            if across[k].any():
                ends[stations[0]].append(LegEnd(both[1] - both[0], across[k, 0], (near[0], near[1])))
                ends[stations[1]].append(LegEnd(both[0] - both[1], -across[k, 1], (far[1], far[0])))
        radii = leg.walls_m.min(axis=1) * leg.surveyed
        shapes += list(shapely.buffer(shapely.points(leg.positions_m), radii, quad_segs=16))
    for name, meeting in ends.items():
        for sector in outer_sectors(meeting, _STEP_RAD, _OVERLAP_RAD):
            radii = sector.radii_m(meeting[sector.one].walls_m[0], meeting[sector.other].walls_m[1])
            arc = places[name] + radii[:, None] * sector.directions
            shapes.append(shapely.Polygon([places[name], *arc]))
    solid = [s for s in shapes if isinstance(s, shapely.Polygon) and not s.is_empty]
    return _without_slits(shapely.union_all(solid))


def require_area(path: Path, workings: BaseGeometry, legs: list[SurveyLeg]) -> None:
    """Refuse workings of no area: both distances are zero at each station.

    Raises
    ------
    InputError
        The message names the stations.
    """
    if workings.is_empty:
        stations = list(dict.fromkeys(name for leg in legs for name in leg.stations))
        raise InputError(
            f"{path}: the stations' walls enclose no area: left and right are 0 at {first_few(stations)}; state the "
            "distances, or none where nobody measured them"
        )


def level_legs(legs: list[SurveyLeg], origin: tuple[float, float]) -> SurveyedLegs:
    """Return legs that are built as a plan, m, mine frame, from their own frame, in which it has an origin."""
    length = float(sum(np.linalg.norm(np.diff(leg.positions_m, axis=0), axis=1).sum() for leg in legs))
    return pack_legs([replace(leg, heights_m=None) for leg in legs], (*origin, 0.0), surveyed_m=length)


def _without_slits(workings: BaseGeometry) -> BaseGeometry:
    """Return the workings without the pillars of no area that rounding leaves along edges that two polygons share."""
    found = [
        shapely.Polygon(part.exterior, [ring for ring in part.interiors if shapely.Polygon(ring).area > _SLIT_M2])
        for part in shapely.get_parts(workings)
    ]
    return found[0] if len(found) == 1 else shapely.MultiPolygon(found)
