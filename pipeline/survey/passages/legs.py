"""Legs of a survey as an artifact holds them, the distances along them, and where they cross."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from minesurveys.errors import InputError
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules
from pipeline.survey.passages.survey_leg import SurveyLeg
from pipeline.types import SurveyedLegs, lines_of, text_array

_BLOCK = 256


def legs_of(surveyed: SurveyedLegs) -> list[SurveyLeg]:
    """Return the legs that an artifact holds, by their numbers; each has its three coordinates."""
    names = lines_of(surveyed.names)
    legs = []
    for number, (begin, end) in enumerate(pairwise(surveyed.first.tolist())):
        places, lrud = surveyed.positions_m[begin:end], surveyed.lrud_m[begin:end]
        heights = np.column_stack([places[:, 2], lrud[:, 2:]])
        sources = surveyed.sources[begin:end] if len(surveyed.sources) else None
        between = surveyed.between[begin:end] > 0 if len(surveyed.between) else None
        rows = names[begin:end], places[:, :2], lrud[:, :2], heights, False, None, sources, between
        legs.append(SurveyLeg(str(number), *rows))
    return legs


def names_between(surveyed: SurveyedLegs) -> set[str]:
    """Return the names of places that are no stations but lie between two."""
    names = np.array(lines_of(surveyed.names))
    is_between = surveyed.between > 0 if len(surveyed.between) else np.zeros(len(names), bool)
    return set(names[is_between].tolist()) - set(names[~is_between].tolist())


def says_enough(distances: np.ndarray) -> bool:
    """Return whether half of the distances (n,) along a row of stations or more were measured."""
    known = np.isfinite(distances).sum()
    return bool(known and 2 * known >= len(distances))


def along_stations(distances: np.ndarray, else_m: float) -> np.ndarray:
    """Return the distances (n,) m along a row of stations without a gap.

    Measured ones stay. If half of the stations or more were measured, a distance is interpolated between them, and
    beyond the first and the last it is that of the nearest. Else it is `else_m` where it was not measured.
    """
    if not says_enough(distances):
        return np.where(np.isfinite(distances), distances, else_m)
    known = np.flatnonzero(np.isfinite(distances))
    return np.interp(np.arange(len(distances)), known, distances[known])


def pack_legs(legs: list[SurveyLeg], origin_m: tuple[float, float, float], **more: Any) -> SurveyedLegs:
    """Return legs as an artifact holds them, m, from an origin in their frame; `more` are its other fields."""
    return SurveyedLegs(
        positions_m=np.concatenate([leg.places_m for leg in legs]) - np.array(origin_m),
        lrud_m=np.concatenate([leg.lrud_m for leg in legs]),
        first=np.cumsum([0, *(len(leg.stations) for leg in legs)]).astype(np.int32),
        names=text_array([name for leg in legs for name in leg.stations]),
        **more,
    )


def require_no_crossing(path: Path, legs: list[SurveyLeg], doubt: str = "", rules: FloorRules = FLOOR_RULES) -> None:
    """Check that legs at about one height cross only at stations; `InputError` names the file, the legs and a doubt."""
    segments = [(leg, a, b) for leg in legs for a, b in pairwise(range(len(leg.stations)))]
    lines = shapely.linestrings([leg.positions_m[[a, b]] for leg, a, b in segments])
    tree = shapely.STRtree(lines)
    for start in range(0, len(lines), _BLOCK):  # the first crossing ends the search
        for k, j in tree.query(lines[start : start + _BLOCK], predicate="crosses").T:
            i = k + start
            if i >= j:
                continue
            (one, a, b), (two, c, d) = segments[i], segments[j]
            at = lines[i].intersection(lines[j]).centroid
            if _pass_over(one, a, b, two, c, d, at.x, at.y, rules):
                continue
            ends = f"{one.stations[a]} to {one.stations[b]}", f"{two.stations[c]} to {two.stations[d]}"
            who = (
                f"leg {one.name} ({ends[0]}) crosses leg {two.name} ({ends[1]})"
                if one.name != two.name
                else f"the shot {ends[0]} crosses {ends[1]}"
            )
            raise InputError(
                f"{path}: {who} at ({at.x:.2f}, {at.y:.2f}) without a station{f'; {doubt}' if doubt else ''}"
            )


def _pass_over(
    one: SurveyLeg, a: int, b: int, two: SurveyLeg, c: int, d: int, x: float, y: float, rules: FloorRules
) -> bool:
    """Return whether two legs with elevations cross at different heights."""
    if one.heights_m is None or two.heights_m is None:
        return False
    heights = []
    for leg, start, end in ((one, a, b), (two, c, d)):
        assert leg.heights_m is not None
        step = leg.positions_m[end] - leg.positions_m[start]
        share = np.dot((x, y) - leg.positions_m[start], step) / np.dot(step, step)
        heights.append(leg.heights_m[start, 0] + share * (leg.heights_m[end, 0] - leg.heights_m[start, 0]))
    return abs(heights[0] - heights[1]) > rules.flat_step_m
