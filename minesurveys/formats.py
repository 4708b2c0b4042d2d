"""The formats of surveys: file name suffix to what the file is and its reader.

To add a format, write its reader in a new module and add one line here, of a station survey another one to
`solved_surveys.py`. `new` and stage 1 choose the reader by suffix.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from minesurveys.converters import CONVERTED
from minesurveys.errors import InputError
from minesurveys.limits import reader_limits
from minesurveys.therion.project import PROJECT, is_project
from minesurveys.vector.earth.gpx import read_gpx
from minesurveys.vector.earth.kml import read_kml
from minesurveys.vector.geodata import read_geodata
from minesurveys.vector.geojson import read_geojson
from minesurveys.vector.shapes import Shapes
from minesurveys.vector.surpac import read_surpac


class FileKind(StrEnum):
    """What a survey's file is, in the words of messages."""

    PICTURE = "a picture"
    PDF = "a PDF"
    GRID = "an occupancy grid"
    VECTOR = "a vector file"
    STATIONS = "a station survey"
    SOLID = "a solid"
    CLOUD = "a point cloud"


# (file, layers or None for all, and of formats with fields the property that is the layer) -> polygons and lines
ShapeReader = Callable[..., Shapes]


@dataclass(frozen=True)
class Format:
    """What files of one suffix are, and the reader of a vector file (`shapes`).

    A survey that is `solved` may name other files, and Survex needs temporary files to read it. The shapes of a vector
    file that `has_fields` have properties.
    """

    kind: FileKind
    shapes: ShapeReader | None = None
    solved: bool = False
    has_fields: bool = False


def _read_dxf(path: Path, layers: list[str] | None) -> Shapes:
    from minesurveys.vector.dxf import read_dxf  # ezdxf takes 0.3 s to load, and few surveys are DXF

    return read_dxf(path, layers)


FORMATS: dict[str, Format] = {
    **dict.fromkeys((".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".gif"), Format(FileKind.PICTURE)),
    ".pdf": Format(FileKind.PDF),
    **dict.fromkeys((".yaml", ".yml"), Format(FileKind.GRID)),
    ".dxf": Format(FileKind.VECTOR, shapes=_read_dxf),
    ".str": Format(FileKind.VECTOR, shapes=read_surpac),
    **dict.fromkeys((".geojson", ".json"), Format(FileKind.VECTOR, shapes=read_geojson, has_fields=True)),
    **dict.fromkeys((".gpkg", ".shp"), Format(FileKind.VECTOR, shapes=read_geodata, has_fields=True)),
    **dict.fromkeys((".kml", ".kmz"), Format(FileKind.VECTOR, shapes=read_kml, has_fields=True)),
    ".gpx": Format(FileKind.VECTOR, shapes=read_gpx, has_fields=True),
    **dict.fromkeys((".obj", ".stl", ".ply", ".glb", ".dtm"), Format(FileKind.SOLID)),
    **dict.fromkeys((".xml", ".landxml", ".dae", ".usd", ".usda", ".usdc", ".omf"), Format(FileKind.SOLID)),
    **dict.fromkeys(
        (".las", ".laz", ".pcd", ".xyz", ".txt", ".pts", ".asc", ".e57", ".ptx", ".bt", ".ot", ".zip"),
        Format(FileKind.CLOUD),
    ),
    ".csv": Format(FileKind.STATIONS),
    **dict.fromkeys(
        (".plt", ".svx", ".3d", ".th", PROJECT, ".lox", ".dat", ".mak", ".clp", ".wpj", ".srv"),
        Format(FileKind.STATIONS, solved=True),
    ),
}


def suffix_of(path: Path) -> str:
    """Return the suffix that names a file's format; the file of a Therion project is mostly called `thconfig` alone."""
    return PROJECT if is_project(path) else path.suffix.lower()


def kind_of(path: Path) -> FileKind:
    """Return what a file is, by its suffix.

    Raises
    ------
    InputError
        If the format is not supported.
    """
    suffix = suffix_of(path)
    if suffix in CONVERTED:
        raise InputError(f"{path}: {suffix} is not read: {CONVERTED[suffix]}")
    if suffix not in FORMATS:
        supported = ", ".join(FORMATS)
        raise InputError(f"{path}: {suffix or 'a file without a suffix'} is not a supported format ({supported})")
    return FORMATS[suffix].kind


def suffixes_of(kind: FileKind) -> tuple[str, ...]:
    """Return the suffixes of the files of a kind."""
    return tuple(suffix for suffix, found in FORMATS.items() if found.kind is kind)


def is_solved(path: Path) -> bool:
    """Return whether a file is a survey in three dimensions, which Survex may solve or which names other files."""
    found = FORMATS.get(suffix_of(path))
    return found is not None and found.solved


def shape_reader(path: Path) -> ShapeReader:
    """Return the reader of a vector file.

    Raises
    ------
    InputError
        If the file is none.
    """
    found = FORMATS.get(suffix_of(path))
    if found is None or found.shapes is None:
        raise InputError(f"{path}: not a supported vector format ({', '.join(suffixes_of(FileKind.VECTOR))})")
    return found.shapes


def solver_limits(path: Path) -> dict[str, Any]:
    """Return what `run_limited` grants a file that Survex solves: more time, and temporary files of a size."""
    limits = reader_limits()
    return {"extra_s": limits.solver_s, "scratch_bytes": limits.scratch_bytes} if is_solved(path) else {}
