"""The formats of vector surveys: file name suffix to reader.

To add a format, write its reader in a new module and add one line here. `new` and stage 1 choose the reader by suffix.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pipeline.survey.passages.legs import SurveyLeg
from pipeline.survey.solved_surveys import read_passages, read_survex
from pipeline.survey.stations.compass import read_plt
from pipeline.survey.stations.table import read_station_legs
from pipeline.survey.vector.dxf import read_dxf
from pipeline.survey.vector.geodata import read_geodata
from pipeline.survey.vector.geojson import read_geojson
from pipeline.survey.vector.shapes import Shapes

ShapeReader = Callable[[Path, list[str] | None], Shapes]  # (file, layers or None for all) -> polygons and lines
# (file, distance to a wall that nobody measured or None) -> (legs, coordinate system or None)
PassageReader = Callable[[Path, float | None], tuple[list[SurveyLeg], str | None]]

SHAPE_READERS: dict[str, ShapeReader] = {
    ".dxf": read_dxf,
    ".geojson": read_geojson,
    ".json": read_geojson,
    ".gpkg": read_geodata,
    ".shp": read_geodata,
}
PASSAGE_READERS: dict[str, PassageReader] = {
    ".csv": lambda path, _: (read_station_legs(path), None),
    ".svx": read_survex,
    ".plt": lambda path, half_width_m: (read_plt(path, half_width_m), None),
    ".3d": read_passages,
    ".th": read_passages,
    ".dat": read_passages,
    ".mak": read_passages,
}
