"""Detect the kind, scale, unit and style of a survey file."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import shapely
from pydantic import ValidationError

from pipeline.errors import InputError
from pipeline.geometry.outline.binarize import dark_pixels
from pipeline.guard.plain_file import require_plain_file
from pipeline.guard.reading_process import Payload, one_line, run_limited
from pipeline.params.reader_limits import reader_limits
from pipeline.params.stated import require_stated
from pipeline.params.survey import (
    CentrelineSurveyParams,
    PassageSurveyParams,
    PlanSurveyParams,
    VectorSurveyParams,
)
from pipeline.survey.drawing.georeference import has_placement, read_placement, world_file
from pipeline.survey.drawing.image import read_image
from pipeline.survey.drawing.picture import draw_page, make_ready, require_few_regions
from pipeline.survey.drawing.scale import find_bar, measure_bar
from pipeline.survey.drawing.workings import WIDTHS_M, draw_detected, find_workings, typical_width_px
from pipeline.survey.formats import PASSAGE_READERS, SHAPE_READERS
from pipeline.survey.grid.nav2 import nav2_picture
from pipeline.survey.grid.plan import draw_grid
from pipeline.survey.levels.walls import axis_of
from pipeline.survey.solved_surveys import SOLVED_SUFFIXES
from pipeline.survey.vector.shapes import METRES, Shapes
from pipeline.survey.vector.sheet_doubts import require_no_sheet
from pipeline.survey.vector_survey import draw_vector_survey, read_shapes, vector_files
from pipeline.types import Georeference, Image, Mask

PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pdf")
_STATED_WIDTHS_M = (0.5, 100.0)  # in the unit that a file states: crawls to stopes; drawings often state a wrong unit
_STATED_WIDTHS_M = (0.5, 100.0)  # in the unit that a file states: from crawls to stopes; some files state a wrong one
_LIKELY_M = 5.5  # usual width of a mechanized drift; that of the published mine at scan 02S
_BARS_M = (10.0, 20.0, 25.0, 50.0, 100.0, 200.0, 250.0, 500.0, 1000.0)
_OF_WALLS = 0.7  # of the length of lines with elevations, that bounds workings; else they are centrelines
_PIECE = "a station of the drivable piece that is built; null: the longest"
_APART_M = 4.0  # between floors over each other: compile3d.height_m and 0.5 m of rock


@dataclass(frozen=True)
class Detection:
    """Values and remarks of a survey section, the files it needs, and the typical drift width, m.

    `picture` shows what of a plan's picture was taken for workings; None for other formats. `has_heights` tells that
    the floor rises or falls.
    """

    values: dict[str, Any]
    remarks: dict[str, str] = field(default_factory=dict)
    files: list[Path] = field(default_factory=list)
    width_m: float = 0.0
    picture: Image | None = None
    has_heights: bool = False


def detect_survey(path: Path, stated: dict[str, Any]) -> Detection:
    """Detect how a file should be read, in a process with the limits of `conf/reader_limits.yaml`.

    Parameters
    ----------
    path : Path
        Any file that stage 1 reads, in any folder.
    stated : dict
        The user's values of `px_per_m`, `bar_length_m`, `bar_box_px`, `unit`, `layers`, `snap_m`, `page`, `dpi`,
        `crop_px`, `level`, `seeds_px`, `wall_gap_px`, `ignore_colours`, `half_width_m`, `grade` of legs.

    Returns
    -------
    Detection

    Raises
    ------
    InputError
        If the file does not exist, its format is not supported, or its scale cannot be found. The message names the
        option that states the scale.
    """
    require_plain_file(path)
    require_stated(path, _kind_of(path), stated)
    scratch = path.suffix.lower() in SOLVED_SUFFIXES
    payload = run_limited("detect", {"path": str(path), "stated": stated}, str(path), scratch=scratch)
    found, files = payload.values, [Path(file) for file in payload.values["files"]]
    picture = payload.arrays.get("detected")
    return Detection(found["values"], found["remarks"], files, found["width_m"], picture, found["has_heights"])


def detect_here(path: str, stated: dict[str, Any]) -> Payload:
    """Detect how a file should be read in this process; `detect_survey` has limits."""
    found = _detect(Path(path), stated)
    files = [str(file) for file in found.files]
    values = {name: value for name, value in vars(found).items() if name != "picture"} | {"files": files}
    return Payload(values, {} if found.picture is None else {"detected": found.picture})


def _kind_of(path: Path) -> str:
    """Return what a file is by its suffix, in the words of `APPLIES`.

    Raises
    ------
    InputError
        If the format is not supported.
    """
    suffix = path.suffix.lower()
    for suffixes, kind in (
        ((".pdf",), "a PDF"),
        (PICTURE_SUFFIXES, "a picture"),
        ((".yaml", ".yml"), "an occupancy grid"),
        (SHAPE_READERS, "a vector file"),
        (PASSAGE_READERS, "a station survey"),
    ):
        if suffix in suffixes:
            return kind
    supported = ", ".join([*PICTURE_SUFFIXES, ".yaml", *SHAPE_READERS, *PASSAGE_READERS])
    raise InputError(f"{path}: {suffix or 'a file without a suffix'} is not a supported format ({supported})")


def _detect(path: Path, stated: dict[str, Any]) -> Detection:
    suffix = path.suffix.lower()
    if suffix in PICTURE_SUFFIXES:
        return _detect_picture(path, stated)
    if suffix in (".yaml", ".yml"):
        plan, frame, _ = draw_grid(path, False)
        width = typical_width_px(plan[..., 0] < 128) / frame.px_per_m
        return Detection({"kind": "grid", "map": path.name}, {}, [path, nav2_picture(path)], width)
    if suffix in SHAPE_READERS:
        if stated.get("half_width_m") is None:
            return _detect_vector(path, stated)
        if stated.get("elevations_m"):
            raise InputError(f"{path}: --elevation is not read with --half-width; centrelines have elevations")
        return _detect_centrelines(path, stated)
    params = PassageSurveyParams(kind="passages", name="detect", file="data/x", heights=None)
    half, grades = stated.get("half_width_m"), stated.get("grade")
    grades = grades if isinstance(grades, dict) else None
    read = {"file": path.as_posix(), "half_width_m": half, "apart_m": _APART_M, "grade": grades}
    params = params.model_copy(update=read | {"piece": stated.get("piece")})
    workings, place, _, _, heights = draw_vector_survey(params)
    values = {"kind": "passages", "file": path.name, "origin": list(place.origin), "half_width_m": half}
    remarks = {
        "origin": "of the mine frame, in the file's coordinates",
        "half_width_m": "distance to a wall that nobody measured, m; null: half the median width of the others",
    }
    if heights is not None:
        values |= {"apart_m": _APART_M, "piece": stated.get("piece")}
        remarks["piece"] = _PIECE
        remarks["apart_m"] = "passages nearer over or under others that they do not meet are left out; null: none"
    if grades is not None:
        values["grade"] = grades
        remarks["grade"] = "rise over run of legs, in the order of their stations"
    width = 2 * workings.area / workings.length
    files = [Path(file) for file in vector_files(params)]
    return Detection(values, remarks, files, width, has_heights=heights is not None)


def _detect_vector(path: Path, stated: dict[str, Any]) -> Detection:
    """Use the unit that the file names, or the unit in which the drifts have a plausible width."""
    tried: dict[str | None, tuple[float, Any, bool]] = {}
    units = [stated["unit"]] if stated.get("unit") else [None, *METRES]
    problem: InputError | None = None
    content = read_shapes(path, stated.get("layers"))
    if path.suffix.lower() == ".dxf" and not stated.get("layers") and not stated.get("elevations_m"):
        require_no_sheet(path, content)
    for unit in units:
        params = _vector(path, unit, stated)
        try:
            workings, place, _, _, heights = draw_vector_survey(params, content)
            if not stated.get("elevations_m"):
                _require_walls(path, content, workings.length / place.metres_per_unit, place)
        except InputError as error:
            problem = problem or error
            continue
        tried[unit] = 2 * workings.area / workings.length, place, heights is not None
        if unit is None and WIDTHS_M[0] <= tried[None][0] <= WIDTHS_M[1]:
            break
    plausible = any(WIDTHS_M[0] <= width <= WIDTHS_M[1] for width, _, _ in tried.values())
    # In a unit small enough, every gap between walls is closed: such a reading must at least be plausible.
    if not tried or (None in units and None not in tried and not plausible):
        lines = all(shapely.get_dimensions(shape) == 1 for shape in content.shapes)
        advice = "; --half-width M reads centrelines of drifts" if lines and "--half-width" not in str(problem) else ""
        raise InputError(f"{problem or f'{path}: has no workings'}{advice}")
    low, high = WIDTHS_M if content.unit is None else _STATED_WIDTHS_M
    keeps_unit = None in tried and (low <= tried[None][0] <= high or tried[None][1].crs is not None)
    unit = None if keeps_unit else min(tried, key=lambda u: abs(np.log(tried[u][0] / _LIKELY_M)))
    width, place, has_heights = tried[unit]
    values = {
        "kind": "vector",
        "file": path.name,
        "layers": stated.get("layers"),
        "unit": unit,
        "origin": list(place.origin),
        "snap_m": stated.get("snap_m") or 0.25,
        "elevations_m": stated.get("elevations_m"),
        "piece": stated.get("piece"),
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
    files = [Path(file) for file in vector_files(_vector(path, unit, stated))]
    return Detection(values, remarks, files, width, has_heights=has_heights)


def _require_walls(path: Path, content: Shapes, walls: float, place: Georeference) -> None:
    """Refuse lines with elevations most of which are no walls of the workings, whose length is given.

    The axes of shafts are neither.
    """
    lines = [shape for shape in content.shapes if shapely.get_dimensions(shape) == 1 and shape.has_z]
    if place.projection is None:
        in_metres = (place.metres_per_unit * shapely.get_coordinates(line, include_z=True) for line in lines)
        lines = [line for line, points in zip(lines, in_metres, strict=True) if axis_of(points) is None]
    distinct = {shapely.normalize(line).wkb: line.length for line in lines}  # drawings often hold a line twice
    if walls < _OF_WALLS * sum(distinct.values()):
        raise InputError(
            f"{path}: its lines have elevations, and most of them bound no workings; --half-width M reads them as "
            "centrelines of drifts, M metres from the line to either wall"
        )


def _detect_centrelines(path: Path, stated: dict[str, Any]) -> Detection:
    """Read the lines of a file as centrelines of drifts of the stated half width."""
    names = ("layers", "unit", "snap_m", "half_width_m", "piece")
    options = {key: stated[key] for key in names if stated.get(key) is not None}
    params = CentrelineSurveyParams.model_validate(
        {"kind": "centrelines", "name": "detect", "file": "data/x", "apart_m": _APART_M, **options}
    ).model_copy(update={"file": path.as_posix()})
    workings, place, _, _, heights = draw_vector_survey(params)
    values = {
        "kind": "centrelines",
        "file": path.name,
        **params.model_dump(include={"layers", "unit", "half_width_m", "snap_m", "apart_m", "piece"}),
        "origin": list(place.origin),
    }
    remarks = {
        **({"projection": _projected(place)} if place.projection and place.crs else {}),
        "half_width_m": "from the line to either wall, m",
        "snap_m": "an end nearer than this to another line joins it",
        "apart_m": "passages nearer over or under others that they do not meet are left out; null: none",
        "piece": _PIECE,
        "layers": "null: all layers; or a list",
        "unit": f"null: the file's unit ({place.unit}); or m, cm, mm, ft, in",
        "origin": "of the mine frame, in the file's coordinates",
    }
    files = [Path(file) for file in vector_files(params)]
    return Detection(values, remarks, files, 2 * workings.area / workings.length, has_heights=heights is not None)


def _projected(place: Georeference) -> str:
    name = one_line(str(place.crs), 40)
    return f"coordinates in {name} are no metres on the ground; they are projected by {place.projection}"


def _vector(path: Path, unit: str | None, stated: dict[str, Any]) -> VectorSurveyParams:
    """Return a survey section for a file in any folder, before it is copied below data/."""
    options = {key: stated[key] for key in ("layers", "snap_m", "elevations_m", "piece") if stated.get(key) is not None}
    section = VectorSurveyParams.model_validate(
        {"kind": "vector", "name": "detect", "file": "data/x", "unit": unit, **options}
    )
    return section.model_copy(update={"file": path.as_posix()})


def _detect_picture(path: Path, stated: dict[str, Any]) -> Detection:
    is_pdf = path.suffix.lower() == ".pdf"
    dpi = float(stated.get("dpi") or 200.0)
    page, most = int(stated.get("page") or 1), reader_limits().megapixels
    picture = draw_page(path, page, dpi, most) if is_pdf else read_image(path, most)
    crop, ignored = stated.get("crop_px"), stated.get("ignore_colours") or []
    edge = np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]]).mean(axis=1)
    inverted = bool(np.median(edge) < 128)
    section = {"crop_px": crop, "ignore_colours": [{"rgb": rgb} for rgb in ignored], "light_on_dark": inverted}
    picture = make_ready(path, picture, _picture_section(section))
    require_few_regions(path, picture)
    scale, remarks, files = _detect_scale(path, picture, stated)
    dark = _workings_mask(picture, scale.get("bar_box_px"))
    per_m = scale["px_per_m"] or 0.0
    found = find_workings(path, picture, dark, per_m, stated)
    if scale["source"] == "bar":
        per_m = _read_bar(path, picture, found.width_px, scale, remarks, stated)
        if not found.sheet:  # strokes count as drifts from a width in metres on
            found = find_workings(path, picture, dark, per_m, stated)
    width_px = found.width_px
    values: dict[str, Any] = {
        "kind": "plan",
        "image": path.name,
        "max_megapixels": most,
        "light_on_dark": inverted,
        "sheet": found.sheet,
        "level": stated.get("level"),
        "line_drawing": found.line_drawing,
        "seeds_px": stated.get("seeds_px") or [],
        "wall_gap_px": stated.get("wall_gap_px") or 3.0,
        "crop_px": crop,
        "turn_deg": 0.0,
        "ignore_colours": section["ignore_colours"],
        **({"page": page, "dpi": dpi} if is_pdf else {}),
        "origin_px": None,
        "scale": scale,
    }
    remarks |= {
        "sheet": "true: a drawing sheet, of which only the workings are kept",
        "level": "which drawing of the sheet, from 1",
        "light_on_dark": "true: light workings on dark paper",
        "line_drawing": "true: walls are drawn as lines; the areas that they enclose are filled",
        "seeds_px": "[[col, row], ...] points inside drawn workings; []: areas inside an odd number of walls",
        "wall_gap_px": "gaps in drawn walls up to this width are closed",
        "crop_px": "[col0, row0, col1, row1]; null: the whole picture",
        "turn_deg": "counter-clockwise, after cropping",
        "ignore_colours": "[{rgb: [r, g, b], within: 30}, ...]",
        "origin_px": "pixel (col, row) at the mine's origin; null: the south-west corner",
    }
    shown = draw_detected(picture, found.mask, scale.get("bar_box_px"))
    return Detection(values, remarks, [path, *files], width_px / per_m, shown)


def _picture_section(values: dict[str, Any]) -> PlanSurveyParams:
    base = {"kind": "plan", "name": "detect", "image": "data/x", "max_megapixels": reader_limits().megapixels}
    try:
        return PlanSurveyParams.model_validate({**base, "scale": {"source": "stated", "px_per_m": 1.0}, **values})
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise InputError(f"survey.{where} = {first['input']!r}: {first['msg']}") from error


def _read_bar(
    path: Path, picture: Image, width_px: float, scale: dict[str, Any], remarks: dict[str, str], stated: dict[str, Any]
) -> float:
    """Measure the bar, state its length in `scale` and `remarks`, and return px/m."""
    bar = measure_bar(_cut(picture, scale["bar_box_px"]), 1.0, f"{path}")
    length = stated.get("bar_length_m") or min(_BARS_M, key=lambda m: abs(np.log(width_px * m / bar / _LIKELY_M)))
    scale["bar_length_m"] = float(length)
    reason = (
        "as stated" if stated.get("bar_length_m") else f"detected: drifts are then {width_px * length / bar:.1f} m wide"
    )
    remarks["scale"] = f"the bar is {bar:.0f} px long and represents {length:g} m ({reason})"
    return float(bar / length)


def _detect_scale(
    path: Path, picture: Image, stated: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, str], list[Path]]:
    scale: dict[str, Any] = {
        "source": "bar",
        "bar_box_px": None,
        "bar_length_m": 100.0,
        "bar_image": None,
        "px_per_m": None,
    }
    if stated.get("px_per_m"):
        return {**scale, "source": "stated", "px_per_m": float(stated["px_per_m"])}, {"scale": "stated"}, []
    if has_placement(path):
        file, place = world_file(path), read_placement(path)
        per_m = 1.0 / (place.size * place.metres_per_unit)
        remark = f"{per_m:.3f} px/m from {file.name if file else 'the file itself'}"
        if place.unit in ("m", "metre") and abs(place.metres_per_unit - 1) > 1e-6:
            remark += f", whose metre is {place.metres_per_unit:.4f} m on the ground ({place.crs})"
        return {**scale, "source": "georeference", "px_per_m": per_m}, {"scale": remark}, [file] if file else []
    box = _stated_box(path, picture, stated) or find_bar(picture)
    if box is None:
        raise InputError(
            f"{path}: no scale bar found; state --px-per-m, or --bar-box COL0,ROW0,COL1,ROW1 and --bar-length"
        )
    return {**scale, "bar_box_px": [int(v) for v in box]}, {}, []


def _stated_box(path: Path, picture: Image, stated: dict[str, Any]) -> list[float] | None:
    """Return the stated box of the scale bar; refuse one that is not inside the picture."""
    box = stated.get("bar_box_px")
    rows, cols = picture.shape[:2]
    if box is not None and not (0 <= box[0] < box[2] <= cols and 0 <= box[1] < box[3] <= rows):
        raise InputError(f"{path}: --bar-box = {list(box)}: not inside the picture of {cols} x {rows} px")
    return box


def _workings_mask(picture: Image, bar_box: list[int] | None) -> Mask:
    """Return the dark, colourless pixels outside the scale bar's box."""
    dark = dark_pixels(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))
    dark[picture.max(axis=2) - picture.min(axis=2) > 40] = False
    if bar_box is not None:
        dark[bar_box[1] : bar_box[3], bar_box[0] : bar_box[2]] = False
    return dark


def _cut(picture: Image, box: list[int]) -> Image:
    return picture[box[1] : box[3], box[0] : box[2]]
