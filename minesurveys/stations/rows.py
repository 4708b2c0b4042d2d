"""Rows of a station table: its columns, which may be in units other than metres, and what stands in them."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from minesurveys.errors import InputError, one_line
from minesurveys.guard.csv_text import read_csv_text, separator_of
from minesurveys.guard.plain_file import require_at_most
from minesurveys.guard.plain_number import plain_number
from minesurveys.remarks import warn_user
from minesurveys.stations.column_names import columns_of, has_names, require_no_readings

COLUMNS = ["leg", "station", "easting_m", "northing_m", "left_m", "right_m"]
WALLS = COLUMNS[4:]
HEIGHTS = ["elevation_m", "up_m", "down_m"]
GRADE = "rise_over_run"
_NUMBERS = [*COLUMNS[2:], *HEIGHTS, GRADE]


def read_rows(
    path: Path, walls_needed: bool = False, stated: Mapping[str, str] | None = None
) -> list[tuple[int, dict[str, str]]]:
    """Return the rows of a table, each with its line, as texts by the names of their columns in metres.

    Columns of walls that the table lacks are empty, unless they are needed. Columns that others name otherwise are
    read, and listed; `stated` says which is which (`columns_of`).

    Raises
    ------
    InputError
        If it is no table of stations, a column is missing or stands twice, or a name cannot be printed.
    """
    text = read_csv_text(path)
    head, separator = text.partition("\n")[0], separator_of(text)
    reader = csv.DictReader(io.StringIO(text), strict=True, delimiter=separator, skipinitialspace=True)
    try:
        names = [name.strip() for name in reader.fieldnames or []]
        is_named = has_names(names) or not stated
        if not is_named:  # its first line is a row, and what is stated are numbers of columns
            names = [str(number) for number in range(1, len(names) + 1)]
            reader = csv.DictReader(io.StringIO(text), names, strict=True, delimiter=separator, skipinitialspace=True)
        elif not stated:
            require_no_readings(path, text)
        columns = columns_of(path, names, COLUMNS if walls_needed else COLUMNS[:4], stated)
        scaled = [column for column in columns if column.metres != 1.0]
        reader.fieldnames = [column.name for column in columns]
        missing = [column for column in COLUMNS if column not in reader.fieldnames]
        if missing and (walls_needed or not set(missing) <= set(WALLS)):
            raise InputError(
                f"{path}: no column {', '.join(missing)} in the first line, {one_line(head, 100)!r}; expected "
                f"{','.join(COLUMNS)}; {_advice(names, missing)}"
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
            row |= dict.fromkeys(missing, "")
            rows.append((reader.line_num, row | {one.name: _in_metres(row[one.name], one.metres) for one in scaled}))
    except csv.Error as error:
        raise InputError(f"{path}:{reader.line_num}: not CSV: a field is too long; is a quote not closed?") from error
    if not rows:
        raise InputError(f"{path}: no stations")
    unread = [name for name in reader.fieldnames if name and name not in (*COLUMNS[:2], *_NUMBERS)]
    if unread:
        warn_user(
            f"columns are not read ({one_line(', '.join(unread), 100)}); heights are read from {', '.join(HEIGHTS)}",
            of=path.name,
            count=len(unread),
        )
    for metres in dict.fromkeys(column.metres for column in scaled):
        of_unit = ", ".join(one_line(name, 40) for name, of in zip(names, columns, strict=True) if of.metres == metres)
        count = sum(column.metres == metres for column in scaled)
        warn_user(f"columns are in units of {metres:.7g} m ({of_unit}); others in metres", of=path.name, count=count)
    return rows


def _advice(names: list[str], missing: list[str]) -> str:
    """Return how the missing columns are stated, by names of the table's columns or by their numbers."""
    needed = [column for column in missing if column not in WALLS]
    example = ",".join(f"{column}=NAME" for column in needed or missing)
    if has_names(names):
        return f"--columns {example} states which these are, and _ft in place of _m that they are in feet"
    return (
        f"it has no names: --columns {example.replace('NAME', 'NUMBER')} states which these are by their numbers from 1"
    )


def _in_metres(text: str | None, metres: float) -> str | None:
    """Return a number of a unit as one of metres; what is no number stays, to be refused with its line."""
    try:
        return repr(plain_number(text or "") * metres)
    except ValueError:
        return text


def _require_name(path: Path, line: int, column: str, name: str | None) -> None:
    """Refuse a name that is empty or holds control characters or invisible ones."""
    if not (name and name.strip() and name.isprintable()):
        raise InputError(f"{path}:{line}: {column} = {name!r:.60}: want a name of printable characters")
