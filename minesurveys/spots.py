"""Reader of spot heights: a CSV file of places on the floor with their elevations."""

from __future__ import annotations

import csv
import io
from collections import Counter
from pathlib import Path

import numpy as np

from minesurveys.errors import InputError
from minesurveys.frames import Georeference, Heights
from minesurveys.guard.csv_text import number_of, read_csv_text, separator_of
from minesurveys.guard.plain_file import require_at_most
from minesurveys.vector.shapes import REACH_M

_COLUMNS = ["easting_m", "northing_m", "elevation_m"]
_REACH = {"easting_m": 1e12, "northing_m": 1e12, "elevation_m": REACH_M}  # eastings in the file's unit

_SAME_M = 0.05  # readings of one place may differ by so much


def read_spots(path: Path, georeference: Georeference) -> Heights:
    """Read spot heights, in the coordinates of the survey's file.

    Raises
    ------
    InputError
        If a column is missing or stands twice, a value is no number or too large, or a place has two heights; the
        message names the line or the place.
    """
    try:
        text = read_csv_text(path)
        separator = separator_of(text)
        reader = csv.DictReader(io.StringIO(text), strict=True, delimiter=separator)
        missing = [column for column in _COLUMNS if column not in (reader.fieldnames or [])]
        if missing:
            raise InputError(f"{path}: no column {', '.join(missing)}; expected {','.join(_COLUMNS)}")
        twice = [column for column, count in Counter(reader.fieldnames or []).items() if count > 1]
        if twice:
            raise InputError(f"{path}: the column {twice[0][:60]!r} stands twice")
        rows = []
        for row in reader:
            if None in row:
                raise InputError(f"{path}:{reader.line_num}: more fields than columns")
            if separator != ",":  # where a comma does not part columns it may begin the decimals
                row = {column: (row[column] or "").replace(",", ".") for column in _COLUMNS}
            rows.append([number_of(path, reader.line_num, name, row[name], _REACH[name]) for name in _COLUMNS])
            require_at_most(path, len(rows), "stations", "spots or more")
    except csv.Error as error:
        raise InputError(f"{path}:{reader.line_num}: not CSV: a field is too long; is a quote not closed?") from error
    if not rows:
        raise InputError(f"{path}: no spots")
    spots = np.array(rows)
    places: dict[tuple[float, float], float] = {}
    for x, y, z in rows:
        if abs(places.setdefault((x, y), z) - z) > _SAME_M:
            raise InputError(f"{path}: two spots at ({x:g}, {y:g}), {places[x, y]:g} m and {z:g} m high")
    datum = float(np.floor(spots[:, 2].min()))
    spots[:, :2] = (spots[:, :2] - georeference.origin) * georeference.metres_per_unit
    spots[:, 2] -= datum
    return Heights(spots=[(float(x), float(y), float(z)) for x, y, z in spots], datum_m=datum)
