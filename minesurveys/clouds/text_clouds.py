"""Points in text: rows of numbers, after spaces, commas or semicolons, below a line of names or none."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from minesurveys.clouds.point_blocks import NO_SYSTEM, PLACES, PointBlock, StatedSystem, Wanted, block_of, fields_of
from minesurveys.clouds.table_columns import best_columns, named_column
from minesurveys.errors import InputError
from minesurveys.guard.plain_number import plain_number
from minesurveys.remarks import warn_user

_BLOCK = 1_000_000
_HEAD_BYTES = 10_000  # of the first line
_COUNT_CHARACTERS = 20
_COUNTED = 20  # rows
_BETWEEN = re.compile(r"[,;\s]+")
_POCKETTOPO = re.compile(r".*\((?:m|ft), (?:360|400)\)")  # the first line of its text: name, unit, degrees of a circle
_AXES = ("easting", "northing", "elevation")
_COLUMNS = ["x", "y", "z"]  # of rows without names
_DAT_COLUMNS = ["time", *_COLUMNS, "intensity"]
_PTS_COLUMNS = [*_COLUMNS, "intensity", "red", "green", "blue"]
_OF_STATIONS = {"leg", "station", "from", "to", "point", "punkt", "pt", "p", "code"}


@dataclass(frozen=True)
class TextLayout:
    """How rows are written: lines above the first one, what separates numbers (None: spaces), and which are read.

    `columns` are the places in a row of `x`, `y`, `z`, and of colours and the time that are wanted and stated. `system`
    has the units in the names of columns.
    """

    above: int
    delimiter: str | None
    columns: dict[str, int]
    system: StatedSystem = NO_SYSTEM


def has_point_rows(path: Path) -> bool:
    """Return whether a table's first line names x, y and z, or is a row of numbers, and names no stations."""
    with path.open(encoding="utf-8-sig", errors="replace") as stream:
        line = stream.readline(_HEAD_BYTES)
    return not _OF_STATIONS & set(_words(line)) and (_named(_names(line)) is not None or _is_row(_words(line)))


def text_blocks(path: Path, wanted: Wanted = PLACES) -> Iterator[PointBlock]:
    """Yield the points of a text file in blocks.

    A line of names above the rows says which columns are x, y and z, and red, green, blue and the time; without one the
    first three are x, y and z. In `.dat` files rows are `time x y z intensity` below a header line. The first line of
    `.pts` files is their number, and may stand above each of several scans, of which Open3D
    reads the first (findings/open3d-pts-first-scan-only.sh); rows of seven columns there are `x y z
    intensity red green blue`.

    Raises
    ------
    InputError
        If a row is too short, or not of numbers. The message names the line.
    """
    with path.open(encoding="utf-8-sig", errors="replace") as stream:
        layout = _layout(path, [stream.readline(_HEAD_BYTES) for _ in range(2)], wanted)
        stream.seek(0)
        has_counts = path.suffix.lower() == ".pts"
        above = list(itertools.islice(stream, layout.above))
        number, found, stated = len(above), 0, _counts(above) if has_counts else []
        while lines := list(itertools.islice(stream, _BLOCK)):
            if has_counts and (more := _counts(lines)):
                stated += more
                lines = ["\n" if _is_count(line) else line for line in lines]
            if any(line.strip() for line in lines):
                columns = parse_rows(path, lines, number, layout)
                _require_no_numbers(path, columns["x"], layout)
                yield block_of(np.column_stack([columns[axis] for axis in "xyz"]), columns, layout.system)
                found += len(columns["x"])
            number += len(lines)
    if not found:
        raise InputError(f"{path}: no rows")
    if stated and sum(stated) != found:
        warn_user(
            f"points, but the counts above its {len(stated)} scans state {sum(stated):,}; if it is cut "
            "off, copy or export it again",
            of=path.name,
            count=f"{found:,}",
        )


def _require_no_numbers(path: Path, x: np.ndarray, layout: TextLayout) -> None:
    """Refuse rows without names whose first column counts them, as lists of surveyed points do."""
    if not layout.above and len(x) >= _COUNTED and (np.diff(x) == 1).all() and x[0] in (0, 1):
        raise InputError(
            f"{path}: its first column counts its rows, and it names no columns: write their names in a line above "
            "them, such as 'number x y z'"
        )


def _is_count(line: str) -> bool:
    return line.strip().isdecimal()


def _counts(lines: list[str]) -> list[int]:
    """Return the numbers that stand alone on a line, above the points of a scan."""
    return [int(line) for line in lines if _is_count(line) and len(line) < _COUNT_CHARACTERS]


def _words(line: str) -> list[str]:
    return [word.strip("\"'").lower() for word in _BETWEEN.split(line.strip().lstrip("#/ ")) if word]


def _names(line: str) -> list[str]:
    """Return the names of columns that a line has, which may be of several words where it has separators."""
    line = line.strip().lstrip("#/ ")
    separator = next((mark for mark in ";,\t" if mark in line), None)
    return [word.strip().strip("\"'").lower() for word in line.split(separator)]


def _named(names: list[str]) -> tuple[int, ...] | None:
    """Return the columns of x, y and z by their names, None if one is not there."""
    found = best_columns(names, _AXES)
    return tuple(found[axis] for axis in _AXES) if len(found) == len(_AXES) else None


def _system(path: Path, names: list[str], places: tuple[int, ...]) -> StatedSystem:
    """Return the units of x and y, and of z, that their names state."""
    x, y, z = (named_column(names[k]) for k in places)
    if x.metres != y.metres:
        raise InputError(f"{path}:1: the columns {names[places[0]]!r} and {names[places[1]]!r} have different units")
    return StatedSystem(plan_m=x.metres if x.unit else None, up_m=z.metres if z.unit else None)


def _is_row(words: list[str]) -> bool:
    try:
        return len([plain_number(word) for word in words]) >= 3
    except ValueError:
        return False


def _layout(path: Path, head: list[str], wanted: Wanted) -> TextLayout:
    suffix, words, names = path.suffix.lower(), _words(head[0]), _names(head[0])
    named = _named(names)
    above = 0 if _is_row(words) or (head[0].startswith("#") and named is None) else 1
    if suffix == ".dat" and not above:
        raise InputError(f"{path}:1: a row of numbers, expected the header line (time x y z intensity)")
    row = head[above]
    delimiter = _delimiter(row.strip())
    is_count = suffix == ".pts" and len(words) == 1
    if above and not is_count and suffix != ".dat" and named is None:
        if _POCKETTOPO.fullmatch(head[0].strip()):
            raise InputError(
                f"{path}: shots that PocketTopo exports, no points; Therion's editor imports it: give the .th"
            )
        raise InputError(f"{path}:1: {head[0].strip()[:60]!r} is no row of numbers, and does not name x, y and z")
    has_colours = is_count and len(row.split(delimiter)) == len(_PTS_COLUMNS)
    unnamed = _DAT_COLUMNS if suffix == ".dat" else _PTS_COLUMNS if has_colours else _COLUMNS
    names, places = (names, named) if named else (unnamed, _named(unnamed) or ())
    extra = {field: names.index(name) for field, name in fields_of(names, wanted).items()}
    return TextLayout(above, delimiter, dict(zip("xyz", places, strict=True)) | extra, _system(path, names, places))


def _delimiter(row: str) -> str | None:
    """Return what parts the columns of a row: a semicolon, a comma, a tab if commas begin decimals, None for spaces."""
    if ";" in row or "," not in row:
        return ";" if ";" in row else None
    return "\t" if "\t" in row and ",\t" not in row else ","


def parse_rows(path: Path, lines: list[str], before: int, layout: TextLayout) -> dict[str, np.ndarray]:
    """Return the columns (n,) of lines that `before` others precede, by name.

    Raises
    ------
    InputError
        If a row is too short, or not of numbers. The message names the line.
    """
    columns = list(layout.columns.values())
    if layout.delimiter in (";", "\t"):  # where a comma does not part columns it may begin the decimals
        lines = [line.replace(",", ".") for line in lines]
    try:
        block = np.loadtxt(lines, usecols=columns, ndmin=2, comments="#", delimiter=layout.delimiter)
    except (ValueError, IndexError):
        block = None
    if block is not None:
        return dict(zip(layout.columns, block.T, strict=True))
    for number, line in enumerate(lines, start=before + 1):
        words = line.split("#")[0].strip().split(layout.delimiter)
        if not any(words):
            continue
        if len(words) <= max(columns):
            raise InputError(
                f"{path}:{number}: {len(words)} columns, at least {max(columns) + 1} are needed; is the file truncated?"
            )
        for word in (words[k].strip() for k in columns):
            try:
                plain_number(word)
            except ValueError:
                raise InputError(f"{path}:{number}: {word[:40]!r} is not a number") from None
    raise InputError(f"{path}: rows {before + 1} to {before + len(lines)} cannot be read as numbers")
