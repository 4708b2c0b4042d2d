"""Reader of Surpac string files (.str): strings of points with z as lines, their numbers as layers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from shapely import LineString

from minesurveys.errors import InputError
from minesurveys.guard.plain_file import read_text_bytes
from minesurveys.guard.plain_number import plain_number
from minesurveys.vector.other_kinds import POINT
from minesurveys.vector.shapes import Shapes, require_size

_HEADERS = 2  # lines before the strings: location, date and purpose; then the axis
_END = "END"
Point = tuple[float, float, float]


def read_surpac(path: Path, layers: list[str] | None) -> Shapes:
    """Read the strings of the given numbers; None reads all.

    A record is a string's number, northing (Y), easting (X), elevation (Z) and descriptions, with commas between them.
    A record of the number 0 ends a piece of a string, and the word END ends the file.

    Parameters
    ----------
    path : Path
    layers : list of str or None
        Numbers of strings, which are the layers of the result.

    Returns
    -------
    Shapes
        Lines (x, y, z) in the file's unit, which a string file does not state.

    Raises
    ------
    InputError
        If the file is a binary string file, a record is none (the message names its line), or a number is unknown.
    """
    pieces: list[tuple[str, list[Point]]] = []
    is_open = False
    for number, point in read_records(path):
        if point is None:
            is_open = False
            continue
        if not is_open or pieces[-1][0] != str(number):
            pieces.append((str(number), []))
        pieces[-1][1].append(point)
        is_open = True
    existing = list(dict.fromkeys(number for number, _ in pieces))
    unknown = sorted(set(layers or []) - set(existing))
    if unknown:
        raise InputError(f"{path}: no string {', '.join(unknown)}; there are {', '.join(existing)}")
    chosen = [(number, points) for number, points in pieces if layers is None or number in layers]
    lines = [(number, points) for number, points in chosen if len(set(points)) > 1]
    others = {POINT: len(chosen) - len(lines)} if len(lines) < len(chosen) else {}
    shapes = [LineString(points) for _, points in lines]
    return Shapes(list(shapes), layer_of=[number for number, _ in lines], others=others)


def read_records(path: Path) -> list[tuple[int, Point | None]]:
    """Read the records of a string file in their order: a string's number and a point, or 0 and None between pieces.

    Raises
    ------
    InputError
        If the file is a binary string file, or a record is none. The message names its line.
    """
    data = read_text_bytes(path)
    if b"\0" in data:
        raise InputError(f"{path}: a binary Surpac string file; save it in Surpac as a text string file")
    require_size(path, data.count(b"\n"))
    text = data.decode("latin-1").splitlines()  # descriptions may be in any encoding; numbers are ASCII
    if len(text) <= _HEADERS:
        raise InputError(f"{path}: not a Surpac string file; it has {len(text)} lines, and its header alone has two")
    records: list[tuple[int, Point | None]] = []
    for row, line in enumerate(text[_HEADERS:], start=_HEADERS + 1):
        cells = [cell.strip() for cell in line.split(",")]
        if not any(cells):
            continue
        number, point = _record(path, row, cells)
        if number == 0 and _END in (cell.upper() for cell in cells[4:]):
            return records
        records.append((number, point if number else None))
    if not any(number for number, _ in records):
        raise InputError(f"{path}: not a Surpac string file; it has neither strings nor a record with END")
    return records


def _record(path: Path, row: int, cells: list[str]) -> tuple[int, Point]:
    """Return a record's number of the string, and its point (x, y, z)."""
    try:
        number, north, east, up = (plain_number(cell) for cell in cells[:4])
        if not number.is_integer() or not np.isfinite([north, east, up]).all():
            raise ValueError("not a finite number")
    except ValueError as error:
        raise InputError(
            f"{path}:{row}: not a record of a Surpac string file: expected the string's number, Y, X and Z with commas "
            f"between them"
        ) from error
    return int(number), (east, north, up)
