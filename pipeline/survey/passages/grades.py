"""Elevations of a station table from the grades of its legs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from minesurveys.errors import InputError
from minesurveys.remarks import warn_user
from pipeline.geometry.floor.grade_heights import heights_of_grades, misclosure_at
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules
from pipeline.survey.passages.survey_leg import SurveyLeg, require_connected

_LEAST_MISCLOSURE_M = 0.01  # smaller misclosures come from the rounding of coordinates
_CHANGED = 1e-6  # smaller changes of a grade come from the solution, also where there is no loop


def with_grades(
    path: Path, legs: list[SurveyLeg], stated: dict[str, float], rules: FloorRules = FLOOR_RULES
) -> list[SurveyLeg]:
    """Return legs with elevations that follow from their grades; the first station of the survey is at 0.

    The misclosure of loops is distributed by least squares, and a warning names the largest one. Legs without a
    grade are linear between their ends (`heights_of_grades`). The roof is not surveyed.

    Parameters
    ----------
    path : Path
        The survey's file, which errors name.
    legs : list of SurveyLeg
        Without elevations; `grades` may hold those of the table.
    stated : dict
        Rise over run by the name of the leg, in the order of its stations.

    Raises
    ------
    InputError
        If a leg is unknown, a grade is stated twice or too steep, or a loop misses by too much; if the legs are not
        connected, or a leg without a grade becomes too steep.
    """
    legs = [_stated(path, leg, stated, rules) for leg in legs]
    unknown = sorted(stated.keys() - {leg.name for leg in legs})
    if unknown:
        names = ", ".join(dict.fromkeys(leg.name for leg in legs))
        raise InputError(f"{path}: a grade of leg {unknown[0]}, which it does not have; there are {names}"[:300])
    require_connected(path, legs)
    number: dict[str, int] = {}
    rows = [np.array([number.setdefault(name, len(number)) for name in leg.stations]) for leg in legs]
    pairs = np.concatenate([np.column_stack([row[:-1], row[1:]]) for row in rows])
    run = np.concatenate([np.linalg.norm(np.diff(leg.positions_m, axis=0), axis=1) for leg in legs])
    grade = np.concatenate([leg.grades for leg in legs if leg.grades is not None])
    z = np.round(heights_of_grades(pairs, run, grade), 6) + 0.0
    built = (z[pairs[:, 1]] - z[pairs[:, 0]]) / run
    shots = [(leg, k) for leg in legs for k in range(len(leg.stations) - 1)]
    changed = np.abs(np.nan_to_num(built - grade))
    worst = int(changed.argmax())
    if changed[worst] > _CHANGED:
        _check_loop(path, shots[worst], misclosure_at(worst, pairs, run, grade), float(changed[worst]), rules)
    steep = int(np.abs(built).argmax())
    _require_gentle(path, *shots[steep], float(built[steep]), rules=rules)
    unmeasured = (np.full(len(row), np.nan) for row in rows)
    return [
        replace(leg, heights_m=np.column_stack([z[row], roof, np.zeros(len(row))]))
        for leg, row, roof in zip(legs, rows, unmeasured, strict=True)
    ]


def _stated(path: Path, leg: SurveyLeg, stated: dict[str, float], rules: FloorRules) -> SurveyLeg:
    """Return a leg with the grade of each shot, nan where there is none."""
    grades = np.full(len(leg.stations) - 1, np.nan) if leg.grades is None else leg.grades
    if leg.name in stated:
        if np.isfinite(grades).any():
            raise InputError(f"{path}: leg {leg.name} has grades in the column rise_over_run; a second one is stated")
        grades = np.full(len(grades), stated[leg.name])
    for k in np.flatnonzero(np.isfinite(grades)).tolist():
        _require_gentle(path, leg, k, float(grades[k]), rules)
    return replace(leg, grades=grades)


def _require_gentle(path: Path, leg: SurveyLeg, k: int, grade: float, rules: FloorRules) -> None:
    most = rules.steepest_grade
    if abs(grade) > most:
        raise InputError(
            f"{path}: leg {leg.name}, {_place(leg, k)}: a grade of {grade:.4g} is steeper than {most:g} "
            f"(survey.steepest_grade)"
        )


def _check_loop(
    path: Path, shot: tuple[SurveyLeg, int], misclosure_m: float, changed: float, rules: FloorRules
) -> None:
    """Warn of the worst misclosure; refuse it if closing it changes a grade by too much."""
    leg, k = shot
    most = rules.grade_change
    found = f"the loop of grades through leg {leg.name}, {_place(leg, k)}, misses by {abs(misclosure_m):.2f} m"
    if changed > most:
        raise InputError(
            f"{path}: {found}; closing it changes a grade by {changed:.5f}, at most {most:g} (survey.grade_change)"
        )
    if abs(misclosure_m) > _LEAST_MISCLOSURE_M:
        warn_user(f"{found}, the most of all; distributed, this changes grades by up to {changed:.5f}", of=path.name)


def _place(leg: SurveyLeg, k: int) -> str:
    x, y = leg.positions_m[k]
    return f"{leg.stations[k]} to {leg.stations[k + 1]} at ({x:.1f}, {y:.1f})"
