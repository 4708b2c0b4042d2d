"""Points in text: rows of numbers, after spaces, commas or semicolons, below a line of names or none."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.guard.plain_number import plain_number
from pipeline.scans.colours import with_colours

TEXT = (".dat", ".xyz", ".txt", ".csv", ".pts", ".asc")
_BLOCK = 1_000_000
_PTS_COLUMNS = 7  # with intensity and colours
_HEAD_BYTES = 10_000  # of the first line
_BETWEEN = re.compile(r"[,;\s]+")
_NAMES = (  # of the columns of x, y and z
    {"x", "x_m", "east", "easting", "easting_m"},
    {"y", "y_m", "north", "northing", "northing_m"},
    {"z", "z_m", "height", "height_m", "elevation", "elevation_m"},
)
_COLOURS = ({"r", "red"}, {"g", "green"}, {"b", "blue"})
_OF_STATIONS = {"leg", "station", "from", "to"}


@dataclass(frozen=True)
class TextLayout:
    """How rows are written: lines above the first one, what separates numbers (None: spaces), and the columns.

    These are of x, y, z, and then of red, green, blue if there are any.
    """

    above: int
    delimiter: str | None
    columns: tuple[int, ...]


def has_point_rows(path: Path) -> bool:
    """Return whether a table's first line names x, y and z, or is a row of numbers, and names no stations."""
    with path.open(encoding="utf-8-sig", errors="replace") as stream:
        line = stream.readline(_HEAD_BYTES)
    words = _words(line)
    return not _OF_STATIONS & set(words) and (_named(words) is not None or _is_row(words))


def text_blocks(path: Path) -> Iterator[np.ndarray]:
    """Yield the points of a text file in blocks (n, 3), or (n, 6) with colours.

    A line of names above the rows says which columns are x, y and z; without one they are the first three. It may name
    red, green and blue. In `.dat` files rows are `time x y z intensity` below a header line. The first line of `.pts`
    files is their number; rows of seven columns there are `x y z intensity red green blue`.

    Raises
    ------
    InputError
        If a row is too short, or not of finite numbers. The message names the line.
    """
    with path.open(encoding="utf-8-sig", errors="replace") as stream:
        layout = _layout(path, [stream.readline(_HEAD_BYTES) for _ in range(2)])
        stream.seek(0)
        number = len(list(itertools.islice(stream, layout.above)))
        found = False
        while lines := list(itertools.islice(stream, _BLOCK)):
            rows = _parse_rows(path, lines, number, layout)
            yield with_colours(rows[:, :3], rows[:, 3:].T) if rows.shape[1] > 3 else rows
            number, found = number + len(lines), True
    if not found:
        raise InputError(f"{path}: no rows")


def _words(line: str) -> list[str]:
    return [word.strip("\"'").lower() for word in _BETWEEN.split(line.strip().lstrip("#/ ")) if word]


def _named(words: list[str], wanted: tuple[set[str], ...] = _NAMES) -> tuple[int, ...] | None:
    """Return the columns of x, y and z, or of others that are wanted, by their names, None if one is not there."""
    found = [[k for k, word in enumerate(words) if word in names] for names in wanted]
    return tuple(columns[0] for columns in found) if all(found) else None


def _is_row(words: list[str]) -> bool:
    try:
        return len([plain_number(word) for word in words]) >= 3
    except ValueError:
        return False


def _layout(path: Path, head: list[str]) -> TextLayout:
    suffix, words = path.suffix.lower(), _words(head[0])
    above = 0 if _is_row(words) or (head[0].startswith("#") and _named(words) is None) else 1
    if suffix == ".dat" and not above:
        raise InputError(f"{path}:1: a row of numbers, expected the header line (time x y z intensity)")
    row = head[above]
    delimiter = next((mark for mark in ";," if mark in row), None)
    columns = _named(words) or ((1, 2, 3) if suffix == ".dat" else (0, 1, 2))
    is_count = suffix == ".pts" and len(words) == 1
    if above and not is_count and suffix != ".dat" and _named(words) is None:
        raise InputError(f"{path}:1: {head[0].strip()[:60]!r} is no row of numbers, and does not name x, y and z")
    has_colours = is_count and len(row.split(delimiter)) == _PTS_COLUMNS
    colours = (4, 5, 6) if has_colours else _named(words, _COLOURS) or ()
    return TextLayout(above, delimiter, columns + colours)


def _parse_rows(path: Path, lines: list[str], before: int, layout: TextLayout) -> np.ndarray:
    columns = layout.columns
    try:
        block = np.loadtxt(lines, usecols=columns, ndmin=2, comments="#", delimiter=layout.delimiter)
    except (ValueError, IndexError):
        block = None
    if block is not None and np.isfinite(block).all():
        return block
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
                finite = np.isfinite(plain_number(word))
            except ValueError:
                raise InputError(f"{path}:{number}: {word[:40]!r} is not a number") from None
            if not finite:
                raise InputError(f"{path}:{number}: {word} is not finite")
    raise InputError(f"{path}: rows {before + 1} to {before + len(lines)} cannot be read as numbers")
