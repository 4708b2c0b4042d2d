"""Legs of a station table: with the elevations that their grades give, and the checks of a network on one floor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from minesurveys.errors import InputError
from minesurveys.solved.model import Passage, SolvedSurvey
from minesurveys.stations.table import read_table
from minesurveys.vector.shapes import REACH_M
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules
from pipeline.survey.passages.grades import with_grades
from pipeline.survey.passages.legs import require_no_crossing
from pipeline.survey.passages.survey_leg import SurveyLeg, cut_at_shafts, require_connected
from pipeline.survey.solved.flatness import require_flat


def read_stations(
    path: Path, grades: dict[str, float] | None = None, rules: FloorRules = FLOOR_RULES
) -> list[SurveyLeg]:
    """Read a station survey and check it.

    Parameters
    ----------
    path : Path
        As of `read_table`.
    grades : dict, optional
        Rise over run by the name of the leg. Elevations follow from grades (`with_grades`).

    Returns
    -------
    list of SurveyLeg
        In the file's order, m, mine frame.

    Raises
    ------
    InputError
        If the table cannot be read; if a leg crosses another one without a station, or is not connected; if grades
        cannot be used; if the workings are too steep or pass over each other. The message names the file, the line or
        leg, and the value.
    """
    result = _graded(path, _legs_of(read_table(path, REACH_M, walls_needed=True)), grades, rules)
    if result[0].heights_m is not None and result[0].grades is None:
        require_flat(path, result, rules)
    require_connected(path, result)
    require_no_crossing(path, result, rules=rules)
    return result


def read_station_legs(
    path: Path,
    grades: dict[str, float] | None = None,
    columns: Mapping[str, str] | None = None,
    rules: FloorRules = FLOOR_RULES,
) -> list[SurveyLeg]:
    """Read a station table that may be steep, pass over itself and be in pieces, else as `read_stations`.

    A distance to a wall may be empty, which is nan. Coordinates may be those of a national grid. Stations of a leg with
    one position in plan are the ends of a shaft, which is a leg of its own, after the others. `columns` names the
    table's columns that are ours (`columns_of`).
    """
    return cut_at_shafts(_graded(path, _legs_of(read_table(path, columns=columns)), grades, rules))


def survey_of_legs(path: Path, legs: list[SurveyLeg]) -> SolvedSurvey:
    """Return the legs of a station table as a survey in three dimensions; stations without elevations are at 0."""
    places = dict[str, np.ndarray]()
    for leg in legs:
        for name, place in zip(leg.stations, leg.places_m, strict=True):
            places.setdefault(name, place)
    number = {name: k for k, name in enumerate(places)}
    passages = [Passage(np.array([number[name] for name in leg.stations]), leg.lrud_m) for leg in legs]
    return SolvedSurvey.of_passages(places, np.array(list(places.values())), passages, path)


def _legs_of(survey: SolvedSurvey) -> list[SurveyLeg]:
    """Return the passages of a table as legs."""
    legs = []
    for passage in survey.passages:
        places, names = survey.positions_m[passage.stations], [survey.names[k] for k in passage.stations]
        heights = np.column_stack([places[:, 2], passage.lrud_m[:, 2:]]) if survey.has_elevations else None
        legs.append(
            SurveyLeg(passage.name, names, places[:, :2], passage.lrud_m[:, :2], heights, grades=passage.grades)
        )
    return legs


def _graded(path: Path, legs: list[SurveyLeg], grades: dict[str, float] | None, rules: FloorRules) -> list[SurveyLeg]:
    """Return legs with the elevations that the grades of the table and the stated ones give, if there are any."""
    if not grades and legs[0].grades is None:
        return legs
    if legs[0].heights_m is not None:
        raise InputError(f"{path}: has elevations (column elevation_m), and grades are stated; give one of them")
    none = [np.full(len(leg.stations) - 1, np.nan) for leg in legs]
    known = [leg if leg.grades is not None else replace(leg, grades=n) for leg, n in zip(legs, none, strict=True)]
    return with_grades(path, known, grades or {}, rules)
