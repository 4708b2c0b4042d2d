"""The formats of surveys: the suffix of a file's name to what the file is, and what reads it.

To add a format, write its reader in a new module and one line here. Another distribution adds one by an entry point of
the group `minesurveys.formats`: its name is the suffix without the dot, its object a `Format`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from importlib.metadata import entry_points
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from minesurveys.converters import CONVERTED
from minesurveys.errors import InputError
from minesurveys.limits import reader_limits

GROUP = "minesurveys.formats"
PROJECT = ".thconfig"


class FileKind(StrEnum):
    """What a survey's file is, in the words of messages."""

    PICTURE = "a picture"
    PDF = "a PDF"
    GRID = "an occupancy grid"
    VECTOR = "a vector file"
    STATIONS = "a station survey"
    SOLID = "a solid"
    CLOUD = "a point cloud"


@dataclass(frozen=True)
class Format:
    """What files of one suffix are, and the reader of each content that they may have, `module:function`.

    A reader is imported when a file needs it. It raises `InputError` for a file that it cannot read.

    Attributes
    ----------
    kind : FileKind
    legs : str
        Takes the file; returns a `SolvedSurvey`.
    survex : str
        Takes the file; returns what Survex is given to solve (`Written`).
    shapes : str
        Takes the file and a list of layers, None for all, and of formats that `has_fields` the property that is the
        layer; returns `Shapes`.
    meshes : str
        Takes the file and its bytes; returns `StatedMeshes`.
    points : str
        Takes the file and what is `Wanted` beside places; yields a `PointBlock` after the other.
    picture : str
        Takes the file and the most megapixels; returns (rows, cols, 3) uint8 BGR.
    grid : str
        Takes the file; returns a `Nav2Map`.
    files : str
        Takes the file; returns all files that are read with it, itself first. None are named by other formats.
    solved : bool
        Survex may solve it, which needs time and temporary files.
    has_fields : bool
        Shapes have properties.
    """

    kind: FileKind
    legs: str = ""
    survex: str = ""
    shapes: str = ""
    meshes: str = ""
    points: str = ""
    picture: str = ""
    grid: str = ""
    files: str = ""
    solved: bool = False
    has_fields: bool = False


_TEXT = "minesurveys.clouds.text_clouds:text_blocks"
_OCTREE = "minesurveys.clouds.octomap_clouds:octomap_blocks"
_LAS = "minesurveys.clouds.las.blocks:las_blocks"
_SCENE = "minesurveys.solids.scenes:read_scene"
_PICTURE = Format(FileKind.PICTURE, picture="minesurveys.pictures.image:read_pixels")
_NAV2 = Format(FileKind.GRID, grid="minesurveys.grid.nav2:read_nav2_map", files="minesurveys.grid.nav2:files_of_map")
_GEOJSON = Format(FileKind.VECTOR, shapes="minesurveys.vector.geojson:read_geojson", has_fields=True)
_GEODATA = Format(FileKind.VECTOR, shapes="minesurveys.vector.geodata:read_geodata", has_fields=True)
_SHAPEFILE = replace(_GEODATA, files="minesurveys.vector.geodata:files_of_shapefile")
_KML = Format(FileKind.VECTOR, shapes="minesurveys.vector.earth.kml:read_kml", has_fields=True)
_LANDXML = Format(FileKind.SOLID, meshes="minesurveys.solids.landxml:read_landxml")
_USD = Format(FileKind.SOLID, meshes="minesurveys.solids.usd:read_usd")
_SOLVED = Format(FileKind.STATIONS, files="minesurveys.solved_surveys:survey_files", solved=True)
_THERION = replace(_SOLVED, survex="minesurveys.therion.convert:to_survex")
_WALLS = replace(_SOLVED, survex="minesurveys.walls.project:copy_of")
_COMPASS = replace(_SOLVED, survex="minesurveys.compass.convert:to_survex")

FORMATS: dict[str, Format] = {
    **dict.fromkeys((".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".gif"), _PICTURE),
    ".pdf": Format(FileKind.PDF, picture="minesurveys.pictures.pages:read_first_page"),
    **dict.fromkeys((".yaml", ".yml"), _NAV2),
    ".dxf": Format(
        FileKind.VECTOR,
        shapes="minesurveys.vector.dxf:read_dxf",
        meshes="minesurveys.solids.dxf_meshes:read_dxf_meshes",
    ),
    ".str": Format(FileKind.VECTOR, shapes="minesurveys.vector.surpac:read_surpac"),
    **dict.fromkeys((".geojson", ".json"), _GEOJSON),
    ".gpkg": _GEODATA,
    ".shp": _SHAPEFILE,
    **dict.fromkeys((".kml", ".kmz"), _KML),
    ".gpx": Format(FileKind.VECTOR, shapes="minesurveys.vector.earth.gpx:read_gpx", has_fields=True),
    **dict.fromkeys((".obj", ".stl", ".glb"), Format(FileKind.SOLID, meshes=_SCENE)),
    ".ply": Format(FileKind.SOLID, meshes="minesurveys.solids.scenes:read_ply"),
    ".dtm": Format(
        FileKind.SOLID,
        meshes="minesurveys.solids.surpac_solid:read_dtm",
        files="minesurveys.solids.surpac_solid:files_of_dtm",
    ),
    **dict.fromkeys((".xml", ".landxml"), _LANDXML),
    ".dae": Format(FileKind.SOLID, meshes="minesurveys.solids.collada:read_collada"),
    **dict.fromkeys((".usd", ".usda", ".usdc"), _USD),
    ".omf": Format(FileKind.SOLID, meshes="minesurveys.solids.mining_format:read_omf"),
    **dict.fromkeys((".las", ".laz"), Format(FileKind.CLOUD, points=_LAS)),
    ".pcd": Format(FileKind.CLOUD, points="minesurveys.clouds.pcd_clouds:pcd_blocks"),
    **dict.fromkeys((".xyz", ".txt", ".pts", ".asc"), Format(FileKind.CLOUD, points=_TEXT)),
    ".e57": Format(FileKind.CLOUD, points="minesurveys.clouds.e57_clouds:e57_blocks"),
    ".ptx": Format(FileKind.CLOUD, points="minesurveys.clouds.ptx_clouds:ptx_blocks"),
    **dict.fromkeys((".bt", ".ot"), Format(FileKind.CLOUD, points=_OCTREE)),
    ".zip": Format(FileKind.CLOUD),  # of clouds in any of these formats
    ".csv": Format(FileKind.STATIONS, legs="minesurveys.stations.table:read_table", points=_TEXT),
    ".plt": replace(_SOLVED, legs="minesurveys.stations.compass:read_plt"),
    ".svx": replace(_SOLVED, survex="minesurveys.survex.survex_text:project_copy"),
    ".3d": replace(_SOLVED, legs="minesurveys.solved.survex_3d:read_3d"),
    **dict.fromkeys((".th", PROJECT), _THERION),
    ".lox": replace(_SOLVED, legs="minesurveys.solved.lox:read_lox"),
    ".dat": replace(_COMPASS, points=_TEXT),
    **dict.fromkeys((".mak", ".clp"), _COMPASS),
    **dict.fromkeys((".wpj", ".srv"), _WALLS),
}


def is_project(path: Path) -> bool:
    """Return whether a file configures a Therion project: `thconfig`, `thconfig.NAME` or `NAME.thconfig`."""
    name, suffix = path.name.lower(), path.suffix.lower()
    return suffix == PROJECT or name == "thconfig" or (name.startswith("thconfig.") and suffix not in (".th", ".th2"))


def suffix_of(path: Path) -> str:
    """Return the suffix that names a file's format; the file of a Therion project is mostly called `thconfig` alone."""
    return PROJECT if is_project(path) else path.suffix.lower()


def format_of(path: Path) -> Format:
    """Return the format of a file, by its suffix.

    Raises
    ------
    InputError
        If the format is not supported.
    """
    suffix = suffix_of(path)
    found = FORMATS.get(suffix) or _installed(suffix)
    if found is not None:
        return found
    if suffix in CONVERTED:
        raise InputError(f"{path}: {suffix} is not read: {CONVERTED[suffix]}")
    supported = ", ".join(FORMATS)
    raise InputError(f"{path}: {suffix or 'a file without a suffix'} is not a supported format ({supported})")


def _installed(suffix: str) -> Format | None:
    """Return the format that another distribution registers for a suffix."""
    found = entry_points(group=GROUP, name=suffix[1:])
    form = next(iter(found)).load() if found else None
    if form is not None and not isinstance(form, Format):
        raise TypeError(f"{next(iter(found)).value}: an entry point of {GROUP} names a Format, not a {type(form)}")
    return form


def kind_of(path: Path) -> FileKind:
    """Return what a file is, by its suffix; `InputError` if the format is not supported."""
    return format_of(path).kind


def suffixes_of(kind: FileKind) -> tuple[str, ...]:
    """Return the suffixes of the files of a kind."""
    return tuple(suffix for suffix, found in FORMATS.items() if found.kind is kind)


def files_of(path: Path) -> list[Path]:
    """Return the files that are read with a file, itself first, without reading it whole.

    Raises
    ------
    InputError
        If its format is not supported, or a file that it names is missing or lies outside its folder.
    """
    named = format_of(path).files
    return resolve_name(named)(path) if named else [path]


def is_solved(path: Path) -> bool:
    """Return whether a file is a survey in three dimensions that Survex may solve."""
    found = FORMATS.get(suffix_of(path))
    return found is not None and found.solved


def shape_reader(path: Path) -> Callable[..., Any]:
    """Return the reader of a vector file.

    Raises
    ------
    InputError
        If the file is none.
    """
    found = format_of(path)
    if not found.shapes:
        raise InputError(f"{path}: not a supported vector format ({', '.join(suffixes_of(FileKind.VECTOR))})")
    return resolve_name(found.shapes)


def solver_limits(path: Path) -> dict[str, Any]:
    """Return what `run_limited` grants a file that Survex solves: more time, and temporary files of a size."""
    limits = reader_limits()
    return {"extra_s": limits.solver_s, "scratch_bytes": limits.scratch_bytes} if is_solved(path) else {}
