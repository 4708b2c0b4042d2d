"""Reader of this project's station table: a CSV file of legs, stations and distances to the left and right wall."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.survey.legs import SurveyLeg, check_network
from pipeline.survey.shapes import REACH_M, read_text_bytes, require_at_most

_COLUMNS = ["leg", "station", "easting_m", "northing_m", "left_m", "right_m"]


def read_stations(path: Path) -> list[SurveyLeg]:
    """Read a station survey and check it.

    Parameters
    ----------
    path : Path
        CSV with the columns leg, station, easting_m, northing_m, left_m, right_m. Left and right are as seen along the
        leg. A station that two legs share has the same name in both.

    Returns
    -------
    list of SurveyLeg
        In the file's order, m, mine frame.

    Raises
    ------
    InputError
        If a column is missing, a value is not a number or a width is negative; if a station has two positions or is
        twice in a leg; if a leg has one station, crosses another leg without a station, or is not connected. The
        message names the file, the line or leg, and the value.
    """
    rows = _read_rows(path)
    legs: dict[str, list[tuple[str, tuple[float, ...]]]] = {}
    positions: dict[str, tuple[tuple[float, float], int]] = {}
    later: set[tuple[str, str]] = set()  # (leg, station) of all stations but a leg's first, which may be its last too
    for line, row in rows:
        values = tuple(_number(path, line, column, row[column]) for column in _COLUMNS[2:])
        for column, value in zip(_COLUMNS[4:], values[2:], strict=True):
            if value < 0:
                raise InputError(f"{path}:{line}: {column} = {value:g} of station {row['station']} is negative")
        position, first = positions.setdefault(row["station"], ((values[0], values[1]), line))
        if position != (values[0], values[1]):
            raise InputError(
                f"{path}:{line}: station {row['station']} at ({values[0]:g}, {values[1]:g}) is at "
                f"({position[0]:g}, {position[1]:g}) in line {first}"
            )
        leg = legs.setdefault(row["leg"], [])
        if (row["leg"], row["station"]) in later or (leg and leg[-1][0] == row["station"]):
            raise InputError(f"{path}:{line}: station {row['station']} occurs twice in leg {row['leg']}")
        if leg:
            later.add((row["leg"], row["station"]))
        leg.append((row["station"], values))
    result = [_leg(path, name, stations) for name, stations in legs.items()]
    check_network(path, result)
    return result


def _read_rows(path: Path) -> list[tuple[int, dict[str, str]]]:
    try:
        text = read_text_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start})") from error
    reader = csv.DictReader(io.StringIO(text), strict=True)
    try:
        missing = [column for column in _COLUMNS if column not in (reader.fieldnames or [])]
        if missing:
            raise InputError(f"{path}: no column {', '.join(missing)}; expected {','.join(_COLUMNS)}")
        rows = []
        for row in reader:
            rows.append((reader.line_num, row))
            require_at_most(path, len(rows), "stations", "stations or more")
    except csv.Error as error:
        raise InputError(f"{path}:{reader.line_num}: not CSV ({error})") from error
    if not rows:
        raise InputError(f"{path}: no stations")
    return rows


def _number(path: Path, line: int, column: str, text: str | None) -> float:
    try:
        value = float(text or "")
    except ValueError:
        raise InputError(f"{path}:{line}: {column} = {text!r} is not a number") from None
    if not math.isfinite(value) or abs(value) > REACH_M:
        raise InputError(
            f"{path}:{line}: {column} = {text} is not within +-{REACH_M:g} m; use coordinates from a local origin"
        )
    return value


def _leg(path: Path, name: str, stations: list[tuple[str, tuple[float, ...]]]) -> SurveyLeg:
    if len(stations) < 2:
        raise InputError(f"{path}: leg {name} has one station ({stations[0][0]}); a leg needs two")
    values = np.array([v for _, v in stations])
    step = np.linalg.norm(np.diff(values[:, :2], axis=0), axis=1)
    if step.min() == 0:
        i = int(step.argmin())
        raise InputError(f"{path}: stations {stations[i][0]} and {stations[i + 1][0]} of leg {name} have one position")
    return SurveyLeg(name, [s for s, _ in stations], values[:, :2], values[:, 2:])
