"""The workings of level legs in plan: each leg as wide as the survey has it, and bends that take nothing of it."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pipeline.survey.passages.legs import SurveyLeg
from pipeline.survey.passages.sections import sections_of

_TURN_RAD = 0.1  # between corners of an arc: 1 mm off at 1 m
_SLIT_M2 = 1e-6
_OVERLAP_RAD = 1e-6  # of a sector with the legs beside it: polygons that only touch leave slits


@dataclass(frozen=True)
class _LegEnd:
    """A leg as seen from one of its stations: its direction, rad, and its walls to the left and right of that, (2,) m.

    `turned` (2,) rad are the turns from its direction to those of its left and right wall.
    """

    place_m: np.ndarray
    direction: float
    turned: tuple[float, float]
    walls_m: tuple[float, float]


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
    ends: dict[str, list[_LegEnd]] = defaultdict(list)
    for leg in legs:
        across = sections_of(leg.positions_m, leg.walls_m)
        left = np.stack([leg.positions_m[:-1], leg.positions_m[1:]], axis=1) + across * _both(leg.walls_m[:, 0])
        right = np.stack([leg.positions_m[:-1], leg.positions_m[1:]], axis=1) - across * _both(leg.walls_m[:, 1])
        shapes += [
            shapely.convex_hull(shapely.multipoints([left[i, 0], left[i, 1], right[i, 1], right[i, 0]]))
            for i in range(len(left))
        ]
        shapes += list(shapely.buffer(shapely.points(leg.positions_m), leg.walls_m.min(axis=1), quad_segs=16))
        for k, stations in enumerate(pairwise(leg.stations)):
            for end, station in enumerate(stations):
                ends[station] += _end_of(leg, k, end, across[k, end])
    shapes += [sector for station in ends.values() for sector in _sectors(station)]
    solid = [s for s in shapes if isinstance(s, shapely.Polygon) and not s.is_empty]
    return _without_slits(shapely.union_all(solid))


def _without_slits(workings: BaseGeometry) -> BaseGeometry:
    """Return the workings without the pillars of no area that rounding leaves along edges that two polygons share."""
    found = [
        shapely.Polygon(part.exterior, [ring for ring in part.interiors if shapely.Polygon(ring).area > _SLIT_M2])
        for part in shapely.get_parts(workings)
    ]
    return found[0] if len(found) == 1 else shapely.MultiPolygon(found)


def _both(walls_m: np.ndarray) -> np.ndarray:
    """Return a wall's distances at both ends of each leg (n - 1, 2, 1) m, from those at the stations (n,) m."""
    return np.stack([walls_m[:-1], walls_m[1:]], axis=1)[:, :, None]


def _end_of(leg: SurveyLeg, k: int, end: int, across: np.ndarray) -> list[_LegEnd]:
    """Return the leg from station `k` to the next as seen from one of the two; none if it has no length in plan."""
    step = leg.positions_m[k + 1 - end] - leg.positions_m[k + end]
    if not across.any() or not step.any():
        return []
    to_left, (left_m, right_m) = (across, leg.walls_m[k]) if end == 0 else (-across, leg.walls_m[k + 1][::-1])
    turned = float(np.arctan2(step[0] * to_left[1] - step[1] * to_left[0], step @ to_left))
    direction = float(np.arctan2(step[1], step[0]))
    return [_LegEnd(leg.positions_m[k + end], direction, (turned, turned - np.pi), (float(left_m), float(right_m)))]


def _sectors(ends: list[_LegEnd]) -> list[shapely.Polygon]:
    """Return the sectors between the walls of legs that follow each other about a station, to the left of the first."""
    if len(ends) < 2:
        return []
    ends = sorted(ends, key=lambda one: one.direction)
    found = []
    for one, other in pairwise([*ends, ends[0]]):
        turn = (other.direction - one.direction) % (2 * np.pi) + other.turned[1] - one.turned[0]
        radii = one.walls_m[0], other.walls_m[1]
        if turn > _OVERLAP_RAD and max(radii) > 0:
            share = np.linspace(0.0, 1.0, int(np.ceil(turn / _TURN_RAD)) + 1)
            overlap = np.linspace(-_OVERLAP_RAD, _OVERLAP_RAD, len(share))
            angle = one.direction + one.turned[0] + share * turn + overlap
            arc = (radii[0] + share * (radii[1] - radii[0])) * np.array([np.cos(angle), np.sin(angle)])
            found.append(shapely.Polygon(np.vstack([one.place_m, one.place_m + arc.T])))
    return found
