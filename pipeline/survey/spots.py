"""Reader of spot heights: a CSV file of places on the floor with their elevations."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.survey.shapes import read_text_bytes, require_at_most
from pipeline.types import Georeference, Heights

_COLUMNS = ["easting_m", "northing_m", "elevation_m"]


def read_spots(path: Path, georeference: Georeference) -> Heights:
    """Read spot heights, in the coordinates of the survey's file.

    Raises
    ------
    InputError
        If a column is missing or a value is not a finite number; the message names the line.
    """
    try:
        reader = csv.DictReader(io.StringIO(read_text_bytes(path).decode("utf-8-sig")), strict=True)
        missing = [column for column in _COLUMNS if column not in (reader.fieldnames or [])]
        if missing:
            raise InputError(f"{path}: no column {', '.join(missing)}; expected {','.join(_COLUMNS)}")
        rows = []
        for row in reader:
            rows.append([_number(path, reader.line_num, column, row[column]) for column in _COLUMNS])
            require_at_most(path, len(rows), "stations", "spots or more")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start})") from error
    except csv.Error as error:
        raise InputError(f"{path}: not CSV ({error})") from error
    if not rows:
        raise InputError(f"{path}: no spots")
    spots = np.array(rows)
    datum = float(np.floor(spots[:, 2].min()))
    spots[:, :2] = (spots[:, :2] - georeference.origin) * georeference.metres_per_unit
    spots[:, 2] -= datum
    return Heights(spots=[(float(x), float(y), float(z)) for x, y, z in spots], datum_m=datum)


def _number(path: Path, line: int, column: str, text: str | None) -> float:
    try:
        value = float(text or "")
    except ValueError:
        raise InputError(f"{path}:{line}: {column} = {text!r} is not a number") from None
    if not math.isfinite(value):
        raise InputError(f"{path}:{line}: {column} = {text} is not finite")
    return value
