"""Detect the kind, scale, unit and style of a survey file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, get_args

import numpy as np
import shapely

from minesurveys.errors import InputError, one_line
from minesurveys.formats import FileKind, kind_of, solver_limits
from minesurveys.frames import METRES, Georeference, Unit
from minesurveys.guard.plain_file import require_plain_file
from minesurveys.guard.reading_process import Payload, run_limited
from minesurveys.reading import read_shapes
from minesurveys.remarks import Remark, collect_remarks, hand_on, warn_user
from minesurveys.vector.shapes import Shapes
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules
from pipeline.params.stated import StatedOptions, require_read
from pipeline.params.survey import CentrelineSurveyParams, GridSurveyParams, PassageSurveyParams, VectorSurveyParams
from pipeline.survey.detection.cloud import detect_cloud, is_cloud
from pipeline.survey.detection.detected_section import Detection, section_for
from pipeline.survey.detection.picture import detect_picture
from pipeline.survey.detection.solid import detect_solid
from pipeline.survey.draw import MineReading
from pipeline.survey.drawing.workings import LIKELY_M, WIDTHS_M
from pipeline.survey.grid.plan import read_free_space
from pipeline.survey.levels.walls import axis_of
from pipeline.survey.vector.drawing_frames import require_no_boundary, require_no_ruled_layer, require_walls_alone
from pipeline.survey.vector.plan_doubts import contours_hint, require_plan, warn_of_crossings
from pipeline.survey.vector_survey import read_vector_survey

_STATED_WIDTHS_M = (0.5, 100.0)  # in the unit that a file states: from crawls to stopes; some files state a wrong one
_DXF, _METRIC = ".dxf", ("m", "cm", "mm")
_OF_WALLS = 0.7  # of the length of lines with elevations, that bounds workings; else they are centrelines
_OF_TABLES = {  # in the section where they are stated
    "declination_deg": "in place of computed ones, deg",
    "grade": "rise over run of legs, in the order of their stations",
    "columns": "our columns of a station table, each with the name of the table's own",
}
_PIECE = "a station of the piece that is built; null: the longest"
_DRAWN = {"layers", "snap_m", "elevations_m", "level_by", "no_elevation", "piece"}  # stated of walls and centrelines


def detect_survey(path: Path, stated: StatedOptions | None = None, rules: FloorRules = FLOOR_RULES) -> Detection:
    """Detect how a file should be read, in a process with the limits of `minesurveys/limits.yaml`.

    `path`: Path; any file that stage 1 reads, in any folder. `stated`: StatedOptions; what the user states about the
    file; None is nothing.
    Returns Detection.
    Raises InputError if the file does not exist, its format is not supported, or its scale cannot be found. The message
    names the option that states the scale.
    """
    require_plain_file(path)
    if not path.stat().st_size:
        raise InputError(f"{path}: empty file")
    stated = stated or StatedOptions()
    if is_cloud(path, stated):  # its points are read in a process of their own
        require_read(path, FileKind.CLOUD, stated)
        return detect_cloud(path, stated)
    require_read(path, kind_of(path), stated)
    arguments = {"path": str(path), "stated": stated.values(), "rules": rules.model_dump()}
    payload = run_limited(detect_here, arguments, str(path), **solver_limits(path))
    files, picture = [Path(file) for file in payload.values["files"]], payload.arrays.get("detected")
    return Detection(**payload.values | {"files": files, "picture": picture})


def detect_here(path: str, stated: dict[str, Any], rules: dict[str, Any] | None = None) -> Payload:
    """Detect how a file should be read in this process; `detect_survey` has limits."""
    found = _detect(Path(path), StatedOptions.model_validate(stated), FloorRules.model_validate(rules or {}))
    values = {n: v for n, v in vars(found).items() if n != "picture"} | {"files": [str(f) for f in found.files]}
    return Payload(values, {} if found.picture is None else {"detected": found.picture})


def _detect(path: Path, stated: StatedOptions, rules: FloorRules = FLOOR_RULES) -> Detection:
    return _DETECTORS[kind_of(path)](path, stated, rules)


def _detect_grid(path: Path, stated: StatedOptions, _rules: FloorRules) -> Detection:
    options = stated.model_dump(include={"narrowest_m", "thinnest_m", "entrance_m"}, exclude_none=True)
    params = section_for(GridSurveyParams, path, {"kind": "grid", **options}, "map")
    read = read_free_space(params)
    values = {"kind": "grid", "map": path.name, **params.model_dump(include={"narrowest_m", "thinnest_m"})}
    remarks = {
        "narrowest_m": "free places narrower than this are left out, m; 0: none",
        "thinnest_m": "thinner walls are made so thick, specks of half of it are left out, m; 0: neither",
    }
    return Detection(values, remarks, list(read.files))


def _detect_drawing(path: Path, stated: StatedOptions, rules: FloorRules) -> Detection:
    """Read the lines of a file as walls, or with a stated half width as centrelines."""
    if stated.volume:
        if path.suffix.lower() == _DXF and stated.half_width_m is None:
            return detect_solid(path, stated)
        raise InputError(f"{path}: --volume reads the solids in a DXF file; other surveys are read without it")
    return (_detect_vector if stated.half_width_m is None else _detect_centrelines)(path, stated, rules)


def _detect_stations(path: Path, stated: StatedOptions, rules: FloorRules) -> Detection:
    options = stated.model_dump(include={"half_width_m", "piece", "declination_deg", "columns"})
    options["grade"] = stated.grade if isinstance(stated.grade, dict) else None
    params = section_for(PassageSurveyParams, path, {"kind": "passages", **options, **rules.model_dump()})
    read = read_vector_survey(params)
    values = {"kind": "passages", "file": path.name, "origin": list(read.georeference.origin)}
    values |= {name: options[name] for name in ("half_width_m", "piece")}
    remarks = {
        "origin": "of the mine frame, in the file's coordinates",
        "half_width_m": "distance to a wall that nobody measured, m; null: half the median width of the others",
        "piece": _PIECE,
    }
    given = [name for name in _OF_TABLES if options[name] is not None]
    values |= {name: options[name] for name in given}
    remarks |= {name: _OF_TABLES[name] for name in given}
    return Detection(values, remarks, [*map(Path, read.files)], read.width_m, has_heights=read.has_heights)


def _detect_vector(path: Path, stated: StatedOptions, rules: FloorRules) -> Detection:
    """Use the unit that the file names, or the unit in which the drifts have a plausible width."""
    tried: dict[Unit | None, MineReading] = {}
    remarks_of: dict[Unit | None, list[Remark]] = {}
    content = read_shapes(path, stated.layers, stated.level_by, stated.no_elevation)
    units: list[Unit | None] = [stated.unit] if stated.unit or content.has_map_unit(path) else [None, *get_args(Unit)]
    problem: InputError | None = None
    has_levels = bool(stated.elevations_m or stated.level_by)
    if not stated.layers and not has_levels:
        require_plan(path, content, rules)
        require_no_boundary(path, content)
    if path.suffix.lower() == ".dxf" and not stated.layers and not has_levels:
        require_walls_alone(path, content, _vector(path, None, stated, rules).snap_m, WIDTHS_M)
    for unit in units:
        params = _vector(path, unit, stated, rules)
        with collect_remarks() as remarks_of[unit]:
            try:
                read = read_vector_survey(params, content)
                if not has_levels:
                    _require_walls(path, content, read, rules)
            except InputError as error:
                problem = problem or error
                continue
        tried[unit] = read
        if unit is None and WIDTHS_M[0] <= read.width_m <= WIDTHS_M[1]:
            break
    plausible = any(WIDTHS_M[0] <= read.width_m <= WIDTHS_M[1] for read in tried.values())
    # In a unit small enough, every gap between walls is closed: such a reading must be plausible, and a unit that the
    # file states, in which walls enclose nothing, is only given up for a larger one.
    usable = tried
    if None in units and None not in tried and content.unit is not None:
        usable = {unit: read for unit, read in tried.items() if METRES[unit or "m"] > METRES[content.unit]}
    if not usable or (None in units and None not in tried and not plausible):
        hand_on(remarks_of[units[0]])
        lines = bool(content.shapes) and all(shapely.get_dimensions(shape) == 1 for shape in content.shapes)
        advice = "; --half-width M reads centrelines of drifts" if lines and "--half-width" not in str(problem) else ""
        if plausible:
            other = _likeliest_unit(content.unit, tried)
            advice += f"; --unit {other} reads drifts {tried[other].width_m:.1f} m wide"
        raise InputError(f"{problem or f'{path}: has no workings'}{advice}{contours_hint(content, rules)}")
    low, high = WIDTHS_M if content.unit is None else _STATED_WIDTHS_M
    keeps_unit = None in tried and (low <= tried[None].width_m <= high or tried[None].georeference.crs is not None)
    unit = None if keeps_unit else _likeliest_unit(content.unit, usable)
    if not keeps_unit and content.unit is not None and unit is not None:
        _warn_of_unit(path, content.unit, tried, unit)
    hand_on(remarks_of[unit])
    read, place = tried[unit], tried[unit].georeference
    unit = unit or (None if content.unit or place.crs else "m")  # a guess is listed
    if not has_levels and not WIDTHS_M[0] <= read.width_m <= WIDTHS_M[1]:
        warn_of_crossings(path, content)
    values = {
        "kind": "vector",
        "file": path.name,
        "layers": stated.layers,
        "unit": unit,
        "origin": list(place.origin),
        "snap_m": _vector(path, unit, stated, rules).snap_m,
        "elevations_m": stated.elevations_m,
        **stated.model_dump(include={"level_by", "no_elevation"}, exclude_none=True),
        "piece": stated.piece,
        "seeds_m": [],
    }
    remarks = {
        **({"projection": _projected(place)} if place.projection and place.crs else {}),
        "layers": "null: all layers; or a list",
        "unit": f"null: the file's unit ({place.unit}); or m, cm, mm, ft, in",
        "origin": "of the mine frame, in the file's coordinates",
        "snap_m": "wall ends closer than this are joined",
        "elevations_m": "{layer: elevation of its floor, m}; null: as the file states them",
        "piece": "a place [x, y, z] in the piece of levels and ramps that is built; null: the largest",
        "seeds_m": "[[x, y], ...] points inside the workings, if the walls enclose other areas too",
    }
    return Detection(values, remarks, [*map(Path, read.files)], read.width_m, has_heights=read.has_heights)


def _likeliest_unit(stated: str | None, tried: Mapping[Unit | None, MineReading]) -> Unit | None:
    """Return the unit in which drifts have about the usual width; a metric drawing keeps to metric ones if it can."""
    metric = [unit for unit in tried if unit in _METRIC and WIDTHS_M[0] <= tried[unit].width_m <= WIDTHS_M[1]]
    units = metric if stated in _METRIC and metric else list(tried)
    return min(units, key=lambda unit: abs(np.log(tried[unit].width_m / LIKELY_M)))


def _warn_of_unit(path: Path, stated: str, tried: Mapping[Unit | None, MineReading], unit: Unit) -> None:
    """Warn that a drawing is read in another unit than it states."""
    width = f"drifts would be {tried[None].width_m:.2g} m wide in it" if None in tried else "it gives no workings"
    warn_user(
        f"states the unit {stated}, and {width}; read as {unit}, which makes them "
        f"{tried[unit].width_m:.1f} m wide; --unit {stated} keeps the stated unit",
        of=path.name,
        option="--unit",
    )


def _require_walls(path: Path, content: Shapes, read: MineReading, rules: FloorRules) -> None:
    """Refuse lines with elevations most of which are no walls of the workings that were read.

    The axes of shafts are neither.
    """
    place = read.georeference
    lines = [shape for shape in content.shapes if shapely.get_dimensions(shape) == 1 and shape.has_z]
    if place.projection is None:
        in_metres = (place.metres_per_unit * shapely.get_coordinates(line, include_z=True) for line in lines)
        lines = [line for line, points in zip(lines, in_metres, strict=True) if axis_of(points, rules) is None]
    distinct = {shapely.normalize(line).wkb: line.length for line in lines}  # drawings often hold a line twice
    if read.walls_m / place.metres_per_unit < _OF_WALLS * sum(distinct.values()):
        raise InputError(
            f"{path}: its lines have elevations, and most of them bound no workings; --half-width M reads them as "
            "centrelines of drifts, M metres from the line to either wall; --layer NAME chooses those that are walls"
        )


def _detect_centrelines(path: Path, stated: StatedOptions, rules: FloorRules) -> Detection:
    """Read the lines of a file as centrelines of drifts of the stated half width."""
    options = stated.model_dump(include={*_DRAWN, "unit", "half_width_m"}, exclude_none=True) | rules.model_dump()
    params = section_for(CentrelineSurveyParams, path, {"kind": "centrelines", **options})
    content = read_shapes(path, stated.layers, stated.level_by, stated.no_elevation)
    if not stated.layers and not stated.elevations_m and not stated.level_by:
        require_no_ruled_layer(path, content, params.snap_m)
    read = read_vector_survey(params, content)
    place = read.georeference
    values = {
        "kind": "centrelines",
        "file": path.name,
        **params.model_dump(include={"layers", "unit", "half_width_m", "snap_m", "piece"}),
        **stated.model_dump(include={"elevations_m", "level_by", "no_elevation"}, exclude_none=True),
        "origin": list(place.origin),
    }
    remarks = {
        **({"projection": _projected(place)} if place.projection and place.crs else {}),
        "half_width_m": "from the line to either wall, m",
        "snap_m": "an end nearer than this to another line joins it",
        "piece": _PIECE,
        "layers": "null: all layers; or a list",
        "unit": f"null: the file's unit ({place.unit}); or m, cm, mm, ft, in",
        "origin": "of the mine frame, in the file's coordinates",
    }
    return Detection(values, remarks, [*map(Path, read.files)], read.width_m, has_heights=read.has_heights)


def _projected(place: Georeference) -> str:
    name = one_line(str(place.crs), 40)
    return f"coordinates in {name} are no metres on the ground; they are projected by {place.projection}"


def _vector(path: Path, unit: Unit | None, stated: StatedOptions, rules: FloorRules) -> VectorSurveyParams:
    """Return a survey section for a file in any folder, before it is copied below data/."""
    options = stated.model_dump(include=_DRAWN, exclude_none=True) | rules.model_dump()
    return section_for(VectorSurveyParams, path, {"kind": "vector", "unit": unit, **options})


_DETECTORS: dict[FileKind, Callable[[Path, StatedOptions, FloorRules], Detection]] = {
    FileKind.PICTURE: lambda path, stated, _: detect_picture(path, stated),
    FileKind.PDF: lambda path, stated, _: detect_picture(path, stated),
    FileKind.GRID: _detect_grid,
    FileKind.VECTOR: _detect_drawing,
    FileKind.STATIONS: _detect_stations,
    FileKind.SOLID: lambda path, stated, _: detect_solid(path, stated),
}
