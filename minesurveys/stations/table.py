"""Reader of this project's station table: a CSV file of legs, stations and distances to the walls, roof and floor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from minesurveys.coordinates.stray_heights import stray_zero
from minesurveys.errors import InputError, one_line
from minesurveys.guard.csv_text import number_of
from minesurveys.guard.plain_number import plain_number
from minesurveys.limits import FILE, reader_limits
from minesurveys.remarks import warn_user
from minesurveys.solved.model import Passage, SolvedSurvey
from minesurveys.stations.rows import COLUMNS, GRADE, HEIGHTS, WALLS, read_rows
from minesurveys.vector.shapes import REACH_M

FARTHEST_M, _HIGHEST_M = 1e8, 1e5  # of national and mine grids; workings and floors are counted from an origin
_UNKNOWN = ("", "-")
_SECTION = (*WALLS, *HEIGHTS[1:])
_ONE_PLACE_M = 0.01  # stations of two legs that are nearer are one, whatever their names


def read_table(
    path: Path, reach_m: float = FARTHEST_M, walls_needed: bool = False, columns: Mapping[str, str] | None = None
) -> SolvedSurvey:
    """Read a station table, whose legs may be steep, pass over each other and be in pieces.

    Parameters
    ----------
    path : Path
        CSV with the columns leg, station, easting_m, northing_m, left_m, right_m. Left and right are as seen along the
        leg. A station that two legs share has the same name in both. Optional: elevation_m, in all rows; up_m and
        down_m, the distances to the roof and the floor, which may be empty. Or rise_over_run, the grade from this
        station to the next of its leg, which may be empty.
    reach_m : float
        The largest coordinate.
    walls_needed : bool
        Whether an empty distance to a wall is refused; else it is nan.
    columns : dict, optional
        The table's columns that are ours (`columns_of`).

    Returns
    -------
    SolvedSurvey
        m; a passage for each leg, in the file's order. Stations of a table without elevations are at 0.

    Raises
    ------
    InputError
        If a column is missing, a value is not a number or a width is negative; if a station has two positions or is
        twice in a leg; if a leg has one station; if an elevation is missing or a stray 0, or a roof is not above its
        floor. The message names the file, the line or leg, and the value.
    """
    rows = read_rows(path, walls_needed, columns)
    has_heights = _has_heights(path, rows)
    legs: dict[str, list[tuple[str, tuple[float, ...]]]] = {}
    stated: dict[str, list[float]] = {}
    positions: dict[str, tuple[tuple[float, ...], int]] = {}
    later: set[tuple[str, str]] = set()  # (leg, station) of all stations but a leg's first, which may be its last too
    repeated: list[int] = []
    for line, row in rows:
        if has_heights and not walls_needed and _has_no_section(row):
            row |= dict.fromkeys(_SECTION, "")
        values = tuple(
            math.nan
            if column in WALLS and not walls_needed and row[column] is not None and row[column].strip() in _UNKNOWN
            else number_of(path, line, column, row[column], reach_m if column in COLUMNS[2:4] else REACH_M)
            for column in COLUMNS[2:]
        )
        for column, value in zip(WALLS, values[2:], strict=True):
            if value < 0:
                raise InputError(f"{path}:{line}: {column} = {value:g} of station {row['station']} is negative")
            _require_near(path, line, column, value, row["station"])
        heights = _heights(path, line, row) if has_heights else ()
        here = (*values[:2], *heights[:1])
        position, first = positions.setdefault(row["station"], (here, line))
        if position != here:
            at, before = (", ".join(f"{value:g}" for value in place) for place in (here, position))
            raise InputError(f"{path}:{line}: station {row['station']} at ({at}) is at ({before}) in line {first}")
        leg = legs.setdefault(row["leg"], [])
        if leg and leg[-1][0] == row["station"] and np.array_equal(leg[-1][1], (*values, *heights), equal_nan=True):
            repeated.append(line)
            continue
        if (row["leg"], row["station"]) in later or (leg and leg[-1][0] == row["station"]):
            raise InputError(f"{path}:{line}: station {row['station']} occurs twice in leg {row['leg']}")
        if leg:
            later.add((row["leg"], row["station"]))
        leg.append((row["station"], (*values, *heights)))
        text = (row.get(GRADE) or "").strip()
        grade = math.nan if text in _UNKNOWN else number_of(path, line, GRADE, text, REACH_M)
        stated.setdefault(row["leg"], []).append(grade)
    if has_heights:
        _require_no_stray_zero(path, list(positions.values()))
    if repeated:
        warn_user(
            f"rows repeat the row before, the first in line {repeated[0]}; left out", of=path.name, count=len(repeated)
        )
    other = _other_names(path, legs, {name: place for name, (place, _) in positions.items()})
    renamed = {leg: [(other.get(name, name), row) for name, row in stations] for leg, stations in legs.items()}
    has_grades = any(math.isfinite(grade) for grades in stated.values() for grade in grades)
    number: dict[str, int] = {}
    places: list[tuple[float, ...]] = []
    passages = []
    for name, stations in renamed.items():
        _require_leg(path, name, stations)
        for station, (east, north, _, _, *height) in stations:
            if number.setdefault(station, len(number)) == len(places):
                places.append((east, north, height[0] if height else 0.0))
        unknown = (math.nan, math.nan)
        lrud = [(left, right, *(height[1:] or unknown)) for _, (_, _, left, right, *height) in stations]
        grades = np.array(stated[name][:-1]) if has_grades else None
        passages.append(Passage(np.array([number[station] for station, _ in stations]), np.array(lrud), name, grades))
    survey = SolvedSurvey.of_passages(number, np.array(places), passages, path)
    return replace(survey, has_elevations=has_heights)


def _other_names(
    path: Path, legs: dict[str, list[tuple[str, tuple[float, ...]]]], places: dict[str, tuple[float, ...]]
) -> dict[str, str]:
    """Return the first name of stations that have another one at the same place in another leg, with a warning."""
    names, other = list(places), dict[str, str]()
    of_leg = [{name for name, _ in stations} for stations in legs.values()]
    for i, j in sorted(cKDTree(np.array(list(places.values()))).query_pairs(_ONE_PLACE_M)):
        first = other.get(names[i], names[i])
        if not any({first, names[j]} <= stations for stations in of_leg):
            other[names[j]] = first
    if other:
        name, first = next(iter(other.items()))
        x, y = places[name][:2]
        warn_user(
            "stations have another name in another leg and are one with it, the first "
            f"{one_line(name, 40)} and {one_line(first, 40)} at ({x:.1f}, {y:.1f}); places 1 cm apart "
            "part them",
            of=path.name,
            count=len(other),
        )
    return other


def _has_no_section(row: dict[str, str]) -> bool:
    """Return whether a row has four zeros for left, right, up and down, as programs write what nobody measured."""
    try:
        return all(plain_number(row.get(column) or "") == 0 for column in _SECTION)
    except ValueError:
        return False


def _has_heights(path: Path, rows: list[tuple[int, dict[str, str]]]) -> bool:
    columns = rows[0][1]
    if "elevation_m" in columns:
        return True
    extra = [column for column in HEIGHTS[1:] if column in columns]
    if extra:
        raise InputError(f"{path}: column {extra[0]} needs a column elevation_m")
    return False


def _heights(path: Path, line: int, row: dict[str, str]) -> tuple[float, ...]:
    """Return elevation, up and down of a row, m; up and down are nan if they are empty."""
    elevation = number_of(path, line, "elevation_m", row["elevation_m"], _HIGHEST_M)
    texts = {column: (row.get(column) or "").strip() for column in HEIGHTS[1:]}
    up, down = (
        math.nan if text in _UNKNOWN else number_of(path, line, column, text, REACH_M) for column, text in texts.items()
    )
    for column, value in zip(HEIGHTS[1:], (up, down), strict=True):
        if value < 0:
            raise InputError(f"{path}:{line}: {column} = {value:g} of station {row['station']} is negative")
        _require_near(path, line, column, value, row["station"])
    if up + down <= 0:
        raise InputError(
            f"{path}:{line}: station {row['station']}: the roof at {elevation + up:g} m is not above the floor at "
            f"{elevation - down:g} m (up_m = {up:g}, down_m = {down:g})"
        )
    return elevation, up, down


def _require_near(path: Path, line: int, column: str, value: float, station: str) -> None:
    """Refuse a distance to wall, roof or floor that is too large; one that is unknown is nan."""
    farthest = reader_limits().farthest_wall_m
    if value > farthest:
        raise InputError(
            f"{path}:{line}: {column} = {value:g} of station {station}, at most {farthest:g} "
            f"(farthest_wall_m in {FILE})"
        )


def _require_no_stray_zero(path: Path, stations: list[tuple[tuple[float, ...], int]]) -> None:
    """Refuse a station, given by its place and line, whose elevation of 0 is a missing value (`stray_zero`)."""
    places = np.array([place for place, _ in stations])
    stray = stray_zero(places)
    if stray is not None:
        others = places[places[:, 2] != 0, 2]
        raise InputError(
            f"{path}:{stations[stray][1]}: elevation_m = 0, but the others lie from {others.min():g} to "
            f"{others.max():g} m; give this station its elevation, leave it out, or write 0.001 if it lies there"
        )


def _require_leg(path: Path, name: str, stations: list[tuple[str, tuple[float, ...]]]) -> None:
    """Refuse a leg of one station, or of two that follow each other at one position."""
    if len(stations) < 2:
        raise InputError(f"{path}: leg {name} has one station ({stations[0][0]}); a leg needs two")
    values = np.array([v for _, v in stations])
    step = np.linalg.norm(np.diff(values[:, [0, 1, 4] if values.shape[1] > 4 else [0, 1]], axis=0), axis=1)
    if step.min() == 0:
        i = int(step.argmin())
        raise InputError(f"{path}: stations {stations[i][0]} and {stations[i + 1][0]} of leg {name} have one position")
