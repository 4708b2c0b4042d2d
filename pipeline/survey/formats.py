"""The formats of surveys: file name suffix to what the file is and its reader.

To add a format, write its reader in a new module and add one line here. `new` and stage 1 choose the reader by suffix.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import InputError
from pipeline.params.stated import FileKind
from pipeline.survey.passages.legs import SurveyLeg
from pipeline.survey.solved_surveys import read_passages
from pipeline.survey.stations.compass import read_plt
from pipeline.survey.stations.table import read_station_legs
from pipeline.survey.vector.dxf import read_dxf
from pipeline.survey.vector.geodata import read_geodata
from pipeline.survey.vector.geojson import read_geojson
from pipeline.survey.vector.shapes import Shapes

ShapeReader = Callable[[Path, list[str] | None], Shapes]  # (file, layers or None for all) -> polygons and lines
# (file, distance to a wall that nobody measured or None) -> (legs, coordinate system or None)
PassageReader = Callable[[Path, float | None], tuple[list[SurveyLeg], str | None]]


@dataclass(frozen=True)
class Format:
    """What files of one suffix are, and the reader of a vector file (`shapes`) or of a station survey (`legs`).

    A survey that is `solved` may name other files, and Survex needs temporary files to read it.
    """

    kind: FileKind
    shapes: ShapeReader | None = None
    legs: PassageReader | None = None
    solved: bool = False


FORMATS: dict[str, Format] = {
    **dict.fromkeys((".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".gif"), Format(FileKind.PICTURE)),
    ".pdf": Format(FileKind.PDF),
    **dict.fromkeys((".yaml", ".yml"), Format(FileKind.GRID)),
    ".dxf": Format(FileKind.VECTOR, shapes=read_dxf),
    **dict.fromkeys((".geojson", ".json"), Format(FileKind.VECTOR, shapes=read_geojson)),
    **dict.fromkeys((".gpkg", ".shp"), Format(FileKind.VECTOR, shapes=read_geodata)),
    ".csv": Format(FileKind.STATIONS, legs=lambda path, _: (read_station_legs(path), None)),
    ".plt": Format(FileKind.STATIONS, legs=lambda path, half_width_m: (read_plt(path, half_width_m), None)),
    **dict.fromkeys((".svx", ".3d", ".th", ".dat", ".mak"), Format(FileKind.STATIONS, legs=read_passages, solved=True)),
}


def kind_of(path: Path) -> FileKind:
    """Return what a file is, by its suffix.

    Raises
    ------
    InputError
        If the format is not supported.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        supported = ", ".join(FORMATS)
        raise InputError(f"{path}: {suffix or 'a file without a suffix'} is not a supported format ({supported})")
    return FORMATS[suffix].kind


def suffixes_of(kind: FileKind) -> tuple[str, ...]:
    """Return the suffixes of the files of a kind."""
    return tuple(suffix for suffix, found in FORMATS.items() if found.kind is kind)


def is_solved(path: Path) -> bool:
    """Return whether a file is a survey that Survex solves, or names other files."""
    found = FORMATS.get(path.suffix.lower())
    return found is not None and found.solved


def shape_reader(path: Path) -> ShapeReader:
    """Return the reader of a vector file.

    Raises
    ------
    InputError
        If the file is none.
    """
    found = FORMATS.get(path.suffix.lower())
    if found is None or found.shapes is None:
        raise InputError(f"{path}: not a supported vector format ({', '.join(suffixes_of(FileKind.VECTOR))})")
    return found.shapes


def leg_reader(path: Path) -> PassageReader:
    """Return the reader of a station survey.

    Raises
    ------
    InputError
        If the file is none.
    """
    found = FORMATS.get(path.suffix.lower())
    if found is None or found.legs is None:
        raise InputError(f"{path}: not a supported passage survey ({', '.join(suffixes_of(FileKind.STATIONS))})")
    return found.legs
