"""The formats of surveys: file name suffix to what the file is and its reader.

To add a format, write its reader in a new module and add one line here. `new` and stage 1 choose the reader by suffix.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import InputError
from pipeline.params.reader_limits import reader_limits
from pipeline.params.stated import FileKind
from pipeline.survey.passages.legs import SurveyLeg
from pipeline.survey.solved_surveys import read_passages
from pipeline.survey.stations.compass import read_plt
from pipeline.survey.stations.table import read_station_legs
from pipeline.survey.vector.geodata import read_geodata
from pipeline.survey.vector.geojson import read_geojson
from pipeline.survey.vector.shapes import Shapes
from pipeline.survey.vector.surpac import read_surpac

# (file, layers or None for all, and of formats with fields the property that is the layer) -> polygons and lines
ShapeReader = Callable[..., Shapes]
# (file, distance to a wall that nobody measured or None) -> (legs, coordinate system or None)
PassageReader = Callable[[Path, float | None], tuple[list[SurveyLeg], str | None]]


@dataclass(frozen=True)
class Format:
    """What files of one suffix are, and the reader of a vector file (`shapes`) or of a station survey (`legs`).

    A survey that is `solved` may name other files, and Survex needs temporary files to read it. The shapes of a vector
    file that `has_fields` have properties.
    """

    kind: FileKind
    shapes: ShapeReader | None = None
    legs: PassageReader | None = None
    solved: bool = False
    has_fields: bool = False


def _read_dxf(path: Path, layers: list[str] | None) -> Shapes:
    from pipeline.survey.vector.dxf import read_dxf  # ezdxf takes 0.3 s to load, and few surveys are DXF

    return read_dxf(path, layers)


FORMATS: dict[str, Format] = {
    **dict.fromkeys((".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".gif"), Format(FileKind.PICTURE)),
    ".pdf": Format(FileKind.PDF),
    **dict.fromkeys((".yaml", ".yml"), Format(FileKind.GRID)),
    ".dxf": Format(FileKind.VECTOR, shapes=_read_dxf),
    ".str": Format(FileKind.VECTOR, shapes=read_surpac),
    **dict.fromkeys((".geojson", ".json"), Format(FileKind.VECTOR, shapes=read_geojson, has_fields=True)),
    **dict.fromkeys((".gpkg", ".shp"), Format(FileKind.VECTOR, shapes=read_geodata, has_fields=True)),
    **dict.fromkeys((".obj", ".stl", ".ply", ".glb", ".dtm"), Format(FileKind.SOLID)),
    **dict.fromkeys((".las", ".laz", ".pcd", ".xyz", ".txt", ".pts", ".asc", ".e57", ".zip"), Format(FileKind.CLOUD)),
    ".csv": Format(FileKind.STATIONS, legs=lambda path, _: (read_station_legs(path), None)),
    ".plt": Format(FileKind.STATIONS, legs=lambda path, half_width_m: (read_plt(path, half_width_m), None)),
    **dict.fromkeys(
        (".svx", ".3d", ".th", ".dat", ".mak", ".clp", ".wpj", ".srv"),
        Format(FileKind.STATIONS, legs=read_passages, solved=True),
    ),
}
# Files that another program turns into one of the formats.
_CONVERTED = {
    ".lox": "Therion writes the same survey as .3d: `export model -fmt survex -o cave.3d`; or give its .th",
    ".top": "PocketTopo exports it as text, which Therion's editor imports; give the .th",
    ".bt": "of an octree of OctoMap give the map.yaml that map_saver writes, or points as .pcd; "
    "of a terrain `gdal_translate in.bt out.tif` makes a GeoTIFF for --heights",
    ".tro": "VisualTopo exports it for Survex or Therion: give the .svx or .th",
    ".trox": "VisualTopo exports it for Survex or Therion: give the .svx or .th",
    ".csx": "cSurvey exports it for Survex or Therion: give the .svx or .th",
    ".pos": "stations without legs; give the .3d that Survex wrote with it",
    ".plf": "Compass writes the same plot as .plt",
    **dict.fromkeys((".dwg", ".dgn"), "the CAD program saves it as .dxf"),
    **dict.fromkeys((".xlsx", ".xls", ".ods"), "a table of stations is saved as .csv"),
    **dict.fromkeys(
        (".kml", ".kmz", ".gml", ".tab", ".mif", ".gdb"),
        "QGIS exports it as GeoPackage, or `ogr2ogr out.gpkg` and its name",
    ),
    **dict.fromkeys(
        (".fgb", ".geojsonl", ".topojson", ".gpx", ".sqlite", ".qgz", ".qgs"),
        "QGIS exports a layer as GeoPackage or GeoJSON",
    ),
    **dict.fromkeys((".7z", ".rar", ".gz"), "unpack it, and give the file of the survey"),
    **dict.fromkeys((".jp2", ".webp", ".heic", ".avif", ".psd", ".ecw", ".sid"), "an image program saves it as .png"),
    **dict.fromkeys((".svg", ".ai", ".eps"), "Inkscape exports it as .pdf, or its lines as .dxf"),
    **dict.fromkeys((".pgm", ".ppm", ".pbm"), "give the .yaml of the map beside it; a plan is saved as .png"),
    **dict.fromkeys((".tsv",), "a table of stations is saved as .csv, with the names of its columns first"),
    **dict.fromkeys((".tdr", ".tdz", ".cave"), "TopoDroid exports it for Survex or Therion: give the .svx or .th"),
    **dict.fromkeys(
        (".3ds", ".3mf", ".dae", ".fbx", ".gltf", ".ifc", ".off", ".skp", ".step", ".stp", ".vtk", ".00t"),
        "the program that made it, or Blender, saves the surface of the workings as .obj, .stl, .ply or .glb",
    ),
    **dict.fromkeys((".ptx", ".rcp", ".rcs"), "CloudCompare saves it as .laz or .xyz"),
    **dict.fromkeys(
        (".bag", ".db3", ".mcap", ".pbstream", ".posegraph"),
        "a recording or a state of a robot; save its map by `map_saver_cli`, and give the .yaml",
    ),
    ".th2": "a drawing of Therion without a survey; give the .th file that inputs it",
}


def kind_of(path: Path) -> FileKind:
    """Return what a file is, by its suffix.

    Raises
    ------
    InputError
        If the format is not supported.
    """
    suffix = path.suffix.lower()
    if suffix in _CONVERTED:
        raise InputError(f"{path}: {suffix} is not read: {_CONVERTED[suffix]}")
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


def solver_limits(path: Path) -> tuple[float, int]:
    """Return the processor time, s, and the bytes of each temporary file that Survex may need; 0 for other files."""
    limits = reader_limits()
    return (limits.solver_s, limits.scratch_bytes) if is_solved(path) else (0.0, 0)


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
