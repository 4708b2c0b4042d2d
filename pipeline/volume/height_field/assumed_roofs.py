"""Roofs that nobody measured, under the surveyed floors of other legs: they end below these, if robots fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely

from pipeline.survey.passages.relief import usual_roof_m
from pipeline.survey.passages.survey_leg import SurveyLeg
from pipeline.volume.network import NEAR_M, SurveyNetwork, network_of
from pipeline.volume.union import STEEPEST

ROCK_M = 0.5  # left between an assumed roof and the floor over it
_LEAST_M = 1.0  # of a passage's height: in lower ones hardly a robot fits, and the roof stays as assumed
_THIN_M = 0.05  # of rock between a roof and the floor over it: a roof with more stays
_LEAST_M2 = 1e-4  # of the place where two legs lie over each other
_SIDES = np.array([1.0, -1.0])[:, None]


def network_with_roofs(
    legs: list[SurveyLeg], height_m: float, half_m: float, roof_m: float | None = None
) -> SurveyNetwork:
    """Return the network of legs whose roofs that nobody measured are `roof_m` over the floor, m.

    Without it they are the usual ones (`usual_roof_m`).

    Where the survey has none they are `height_m` over the floor; under floors that pass over them they are lower. Half
    widths that nobody measured are `half_m`.
    """
    return lower_assumed_roofs(network_of(legs, roof_m or usual_roof_m(legs) or height_m, half_m))


def lower_assumed_roofs(network: SurveyNetwork) -> SurveyNetwork:
    """Return the network whose assumed roofs end `ROCK_M` below floors that they would reach, of legs that pass over.

    A leg passes over another if its floor is higher all over the place that both cover, seen from above, and the two
    are not near each other along the survey. Roofs that were measured stay, and those of passages that would be lower
    than 1 m. No roof is lower than its station.
    """
    tall = network.lrud_m[:, :, 2:].sum(axis=2)
    most = np.full(len(network.places_m), np.inf)  # m, of the passage's height at each station
    for leg, gap in _floors_over(network):
        if _LEAST_M + ROCK_M <= gap < tall[leg].max() + _THIN_M:
            stations = network.shots[leg]
            most[stations] = np.minimum(most[stations], gap - ROCK_M)
    lrud, wanted = network.lrud_m.copy(), most[network.shots]
    lower = network.roof_assumed & (tall > wanted)
    lrud[:, :, 2] = np.where(lower, np.maximum(wanted - lrud[:, :, 3], 0.0), lrud[:, :, 2])
    return replace(network, lrud_m=lrud, roof_lowered=lower) if lower.any() else network


def _floors_over(network: SurveyNetwork) -> Iterator[tuple[int, float]]:
    """Yield legs with an assumed roof, and how far, m, the floor of another leg is over theirs at the least."""
    grades = network.grades
    assumed = np.flatnonzero(network.roof_assumed.any(axis=1) & np.isfinite(grades))
    flat = np.flatnonzero(grades <= STEEPEST)
    if not len(assumed) or not len(flat):
        return
    sides = network.floors_m[:, :, None, :2] + network.across[:, :, None] * network.lrud_m[:, :, :2, None] * _SIDES
    outlines = shapely.convex_hull(shapely.multipoints(sides.reshape(len(sides), 4, 2)))
    one, two = shapely.STRtree(outlines[flat]).query(outlines[assumed], predicate="intersects")
    under, over = assumed[one], flat[two]
    apart = ~network.near_legs(NEAR_M).has(under, over)
    under, over = under[apart], over[apart]
    both = shapely.intersection(outlines[under], outlines[over])
    for a, b, place in zip(under.tolist(), over.tolist(), both.tolist(), strict=True):
        if place.area > _LEAST_M2:
            corners = shapely.get_coordinates(place)
            gap = float((_floor_at(network, b, corners) - _floor_at(network, a, corners)).min())
            yield a, gap


def _floor_at(network: SurveyNetwork, leg: int, places: np.ndarray) -> np.ndarray:
    """Return a leg's floor (n,) m at places (n, 2) m, by how far along the leg they are."""
    start, end = network.floors_m[leg]
    step = end - start
    share = np.clip((places - start[:2]) @ step[:2] / (step[:2] @ step[:2]), 0, 1)
    found: np.ndarray = start[2] + share * step[2]
    return found
