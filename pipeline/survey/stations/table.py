"""Reader of this project's station table: a CSV file of legs, stations and distances to the walls, roof and floor."""

from __future__ import annotations

import csv
import io
import math
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.guard.csv_text import read_csv_text, separator_of
from pipeline.guard.plain_file import require_at_most
from pipeline.guard.plain_number import plain_number
from pipeline.guard.reading_process import one_line
from pipeline.params.reader_limits import FILE, reader_limits
from pipeline.survey.passages.grades import with_grades
from pipeline.survey.passages.legs import (
    SurveyLeg,
    check_network,
    without_shots,
)
from pipeline.survey.passages.stray_heights import stray_zero
from pipeline.survey.solved.flatness import Section, require_flat
from pipeline.survey.solved.model import LegStyle, Passage, SolvedSurvey, StationFlag
from pipeline.survey.vector.shapes import REACH_M

_COLUMNS = ["leg", "station", "easting_m", "northing_m", "left_m", "right_m"]
_HEIGHTS = ["elevation_m", "up_m", "down_m"]
_GRADE = "rise_over_run"
_NUMBERS = [*_COLUMNS[2:], *_HEIGHTS, _GRADE]
_FARTHEST_M, _HIGHEST_M = 1e8, 1e5  # of national and mine grids; workings and floors are counted from an origin
_UNKNOWN = ("", "-")


def read_stations(path: Path, grades: dict[str, float] | None = None) -> list[SurveyLeg]:
    """Read a station survey and check it.

    Parameters
    ----------
    path : Path
        CSV with the columns leg, station, easting_m, northing_m, left_m, right_m. Left and right are as seen along the
        leg. A station that two legs share has the same name in both. Optional: elevation_m, in all rows; up_m and
        down_m, the distances to the roof and the floor, which may be empty. Or rise_over_run, the grade from this
        station to the next of its leg, which may be empty.
    grades : dict, optional
        Rise over run by the name of the leg. Elevations follow from grades (`with_grades`).

    Returns
    -------
    list of SurveyLeg
        In the file's order, m, mine frame.

    Raises
    ------
    InputError
        If a column is missing, a value is not a number or a width is negative; if a station has two positions or is
        twice in a leg; if a leg has one station, crosses another leg without a station, or is not connected; if an
        elevation is missing or a stray 0, or a roof is not above its floor; if grades cannot be used; if the workings
        are too steep or pass over each other. The message names the file, the line or leg, and the value.
    """
    result = _read_legs(path, grades=grades)
    if result[0].heights_m is not None and result[0].grades is None:
        require_flat(path, [section_of(leg) for leg in result])
    check_network(path, result)
    return result


def read_station_legs(path: Path, grades: dict[str, float] | None = None) -> list[SurveyLeg]:
    """Read a station table that may be steep, pass over itself and be in pieces, else as `read_stations`.

    Coordinates may be those of a national grid. Stations of a leg with one position in plan are the ends of a shaft,
    which is a leg of its own, after the others.
    """
    legs = _read_legs(path, _FARTHEST_M, grades)
    shafts = [_shaft(leg, k) for leg in legs for k in _plumb(leg)]
    return [piece for leg in legs for piece in without_shots(leg, set(_plumb(leg)))] + shafts


def _plumb(leg: SurveyLeg) -> list[int]:
    """Return the stations of a leg below or above which the next one lies."""
    return np.flatnonzero(np.linalg.norm(np.diff(leg.positions_m, axis=0), axis=1) == 0).tolist()


def _shaft(leg: SurveyLeg, k: int) -> SurveyLeg:
    assert leg.heights_m is not None
    at = [k, k + 1]
    names = [leg.stations[i] for i in at]
    return SurveyLeg("plumb", names, leg.positions_m[at], leg.walls_m[at], leg.heights_m[at], True)


def section_of(leg: SurveyLeg) -> Section:
    """Return a leg with elevations as a section of stations in three dimensions."""
    assert leg.heights_m is not None
    places = np.column_stack([leg.positions_m, leg.heights_m[:, 0]])
    return Section(leg.stations, places, np.column_stack([leg.walls_m, leg.heights_m[:, 1:]]))


def read_station_survey(path: Path) -> SolvedSurvey:
    """Read a station table with elevations as a survey in three dimensions.

    Raises
    ------
    InputError
        If the table has no elevations or is not valid; it may be steep and pass over itself.
    """
    return survey_of_legs(path, _read_legs(path, _FARTHEST_M))


def survey_of_legs(path: Path, legs: list[SurveyLeg]) -> SolvedSurvey:
    """Return the legs of a station table as a survey in three dimensions; `InputError` if they have no elevations."""
    if legs[0].heights_m is None:
        raise InputError(f"{path}: no column elevation_m; a survey in three dimensions needs it")
    number: dict[str, int] = {}
    places: list[np.ndarray] = []
    for section in map(section_of, legs):
        for name, place in zip(section.names, section.positions_m, strict=True):
            if number.setdefault(name, len(number)) == len(places):
                places.append(place)
    rows = [np.array([number[name] for name in leg.stations]) for leg in legs]
    pairs = np.concatenate([np.column_stack([row[:-1], row[1:]]) for row in rows])
    passages = tuple(Passage(row, section_of(leg).lrud_m) for row, leg in zip(rows, legs, strict=True))
    flags = np.full(len(places), StationFlag.UNDERGROUND, np.uint8)
    styles = np.full(len(pairs), LegStyle.CARTESIAN, np.uint8)
    plain = np.zeros(len(pairs), np.uint8)
    return SolvedSurvey(tuple(number), np.array(places), flags, pairs, plain, styles, passages, path.stem)


def _read_legs(path: Path, reach_m: float = REACH_M, grades: dict[str, float] | None = None) -> list[SurveyLeg]:
    rows = _read_rows(path)
    has_heights = _has_heights(path, rows)
    has_grades = bool(grades) or any((row.get(_GRADE) or "").strip() not in _UNKNOWN for _, row in rows)
    if has_heights and has_grades:
        raise InputError(f"{path}: has elevations (column elevation_m), and grades are stated; give one of them")
    legs: dict[str, list[tuple[str, tuple[float, ...]]]] = {}
    stated: dict[str, list[float]] = {}
    positions: dict[str, tuple[tuple[float, ...], int]] = {}
    later: set[tuple[str, str]] = set()  # (leg, station) of all stations but a leg's first, which may be its last too
    for line, row in rows:
        values = tuple(
            _number(path, line, column, row[column], reach_m if column in _COLUMNS[2:4] else REACH_M)
            for column in _COLUMNS[2:]
        )
        for column, value in zip(_COLUMNS[4:], values[2:], strict=True):
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
        if (row["leg"], row["station"]) in later or (leg and leg[-1][0] == row["station"]):
            raise InputError(f"{path}:{line}: station {row['station']} occurs twice in leg {row['leg']}")
        if leg:
            later.add((row["leg"], row["station"]))
        leg.append((row["station"], (*values, *heights)))
        text = (row.get(_GRADE) or "").strip()
        grade = math.nan if text in _UNKNOWN else _number(path, line, _GRADE, text)
        stated.setdefault(row["leg"], []).append(grade)
    if has_heights:
        _require_no_stray_zero(path, list(positions.values()))
    found = [_leg(path, name, stations) for name, stations in legs.items()]
    if not has_grades:
        return found
    of_table = [replace(leg, grades=np.array(stated[leg.name][:-1])) for leg in found]
    return with_grades(path, of_table, grades or {})


def _has_heights(path: Path, rows: list[tuple[int, dict[str, str]]]) -> bool:
    columns = rows[0][1]
    if "elevation_m" in columns:
        return True
    extra = [column for column in _HEIGHTS[1:] if column in columns]
    if extra:
        raise InputError(f"{path}: column {extra[0]} needs a column elevation_m")
    return False


def _heights(path: Path, line: int, row: dict[str, str]) -> tuple[float, ...]:
    """Return elevation, up and down of a row, m; up and down are nan if they are empty."""
    elevation = _number(path, line, "elevation_m", row["elevation_m"], _HIGHEST_M)
    up, down = (
        _number(path, line, column, text) if (text := (row.get(column) or "").strip()) not in _UNKNOWN else math.nan
        for column in _HEIGHTS[1:]
    )
    for column, value in zip(_HEIGHTS[1:], (up, down), strict=True):
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


def _read_rows(path: Path) -> list[tuple[int, dict[str, str]]]:
    text = read_csv_text(path)
    head, separator = text.partition("\n")[0], separator_of(text)
    reader = csv.DictReader(io.StringIO(text), strict=True, delimiter=separator, skipinitialspace=True)
    try:
        reader.fieldnames = [name.strip().lower() for name in reader.fieldnames or []]
        missing = [column for column in _COLUMNS if column not in reader.fieldnames]
        if missing:
            raise InputError(
                f"{path}: no column {', '.join(missing)} in the first line, {one_line(head, 100)!r}; expected "
                f"{','.join(_COLUMNS)}"
            )
        twice = [column for column, count in Counter(reader.fieldnames).items() if count > 1]
        if twice:
            raise InputError(f"{path}: the column {twice[0][:60]!r} stands twice")
        rows = []
        for number, row in enumerate(reader, 1):
            require_at_most(path, number, "stations", "rows or more")
            if None in row:
                raise InputError(f"{path}:{reader.line_num}: more fields than columns")
            if not any(text and text.strip() for text in row.values()):
                continue
            for column in ("leg", "station"):
                _require_name(path, reader.line_num, column, row[column])
            if separator != ",":  # where a comma does not part columns it may begin the decimals
                row |= {column: (row[column] or "").replace(",", ".") for column in _NUMBERS if column in row}
            rows.append((reader.line_num, row))
    except csv.Error as error:
        raise InputError(f"{path}:{reader.line_num}: not CSV: a field is too long; is a quote not closed?") from error
    if not rows:
        raise InputError(f"{path}: no stations")
    return rows


def _require_name(path: Path, line: int, column: str, name: str | None) -> None:
    """Refuse a name that is empty or holds control characters or invisible ones."""
    if not (name and name.strip() and name.isprintable()):
        raise InputError(f"{path}:{line}: {column} = {name!r:.60}: want a name of printable characters")


def _number(path: Path, line: int, column: str, text: str | None, reach_m: float = REACH_M) -> float:
    try:
        value = plain_number(text or "")
    except ValueError:
        raise InputError(f"{path}:{line}: {column} = {text!r} is not a number") from None
    if not math.isfinite(value):
        raise InputError(f"{path}:{line}: {column} = {text} is not a finite number")
    if abs(value) > reach_m:
        raise InputError(
            f"{path}:{line}: {column} = {text} is not within +-{reach_m:g} m; use coordinates from a local origin"
        )
    return value


def _leg(path: Path, name: str, stations: list[tuple[str, tuple[float, ...]]]) -> SurveyLeg:
    if len(stations) < 2:
        raise InputError(f"{path}: leg {name} has one station ({stations[0][0]}); a leg needs two")
    values = np.array([v for _, v in stations])
    step = np.linalg.norm(np.diff(values[:, [0, 1, 4] if values.shape[1] > 4 else [0, 1]], axis=0), axis=1)
    if step.min() == 0:
        i = int(step.argmin())
        raise InputError(f"{path}: stations {stations[i][0]} and {stations[i + 1][0]} of leg {name} have one position")
    heights = values[:, 4:] if values.shape[1] > 4 else None
    return SurveyLeg(name, [s for s, _ in stations], values[:, :2], values[:, 2:4], heights)
