"""Detect what a survey file is and how it should be read: kind, scale, unit, style."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pipeline.errors import GeometryError, InputError
from pipeline.geometry.binarize import dark_pixels
from pipeline.geometry.line_drawing import fill_line_drawing
from pipeline.params.survey import PassageSurveyParams, VectorSurveyParams
from pipeline.survey.formats import PASSAGE_READERS, SHAPE_READERS
from pipeline.survey.georeference import read_placement, world_file
from pipeline.survey.grid import draw_grid
from pipeline.survey.image import read_image
from pipeline.survey.nav2 import nav2_picture
from pipeline.survey.picture import draw_page
from pipeline.survey.scale import find_bar, measure_bar
from pipeline.survey.shapes import METRES
from pipeline.survey.vector_survey import draw_vector_survey, vector_files
from pipeline.types import Image, Mask

PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pdf")
WIDTHS_M = (1.5, 12.0)  # the widths that drifts have in practice
_LIKELY_M = 5.5  # width of drifts that machines drive; the published mine's at scan 02S
_BARS_M = (10.0, 20.0, 25.0, 50.0, 100.0, 200.0, 250.0, 500.0, 1000.0)
_MEGAPIXELS = 200.0
_LINE_PX = 6.0  # a stroke that is wider is no line, where the scale is not known


@dataclass(frozen=True)
class Detection:
    """How a file is read: the survey section's values, each with a remark, and the files that belong to it."""

    values: dict[str, Any]
    remarks: dict[str, str] = field(default_factory=dict)
    files: list[Path] = field(default_factory=list)
    width_m: float = 0.0


def detect_survey(path: Path, stated: dict[str, Any]) -> Detection:
    """Detect how a file should be read.

    Parameters
    ----------
    path : Path
        Any file that stage 1 reads, wherever it lies.
    stated : dict
        What the user states: `px_per_m`, `bar_length_m`, `bar_box_px`, `unit`, `layers`, `snap_m`, `page`, `dpi`.

    Raises
    ------
    InputError
        If there is no such file, nothing reads it, or its scale cannot be found; the message says what to state.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    suffix = path.suffix.lower()
    if suffix in PICTURE_SUFFIXES:
        return _detect_picture(path, stated)
    if suffix in (".yaml", ".yml"):
        plan, frame, _ = draw_grid(path, False)
        width = typical_width_px(plan[..., 0] < 128) / frame.px_per_m
        return Detection({"kind": "grid", "map": path.name}, {}, [path, nav2_picture(path)], width)
    if suffix in SHAPE_READERS:
        return _detect_vector(path, stated)
    if suffix in PASSAGE_READERS:
        params = PassageSurveyParams(kind="passages", name="detect", file="data/x")
        params = params.model_copy(update={"file": path.as_posix()})
        workings, place, _, _ = draw_vector_survey(params)
        values = {"kind": "passages", "file": path.name, "origin": list(place.origin)}
        remarks = {"origin": "of the mine frame, in the file's coordinates"}
        return Detection(values, remarks, [Path(f) for f in vector_files(params)], 2 * workings.area / workings.length)
    known = ", ".join([*PICTURE_SUFFIXES, ".yaml", *SHAPE_READERS, *PASSAGE_READERS])
    raise InputError(f"{path}: {suffix or 'a file without an ending'} is not a format that is read ({known})")


def _detect_vector(path: Path, stated: dict[str, Any]) -> Detection:
    """Read the shapes by the unit that the file names, or the one that makes the drifts as wide as drifts are."""
    tried: dict[str | None, tuple[float, Any]] = {}
    units = [stated["unit"]] if stated.get("unit") else [None, *METRES]
    problem: InputError | None = None
    for unit in units:
        params = _vector(path, unit, stated)
        try:
            workings, place, _, _ = draw_vector_survey(params)
        except InputError as error:
            problem = problem or error
            continue
        tried[unit] = 2 * workings.area / workings.length, place
        if unit is None and WIDTHS_M[0] <= tried[None][0] <= WIDTHS_M[1]:
            break
    if not tried:
        raise problem or InputError(f"{path}: holds no workings")
    stays = None in tried and (WIDTHS_M[0] <= tried[None][0] <= WIDTHS_M[1] or tried[None][1].crs is not None)
    unit = None if stays else min(tried, key=lambda u: abs(np.log(tried[u][0] / _LIKELY_M)))
    width, place = tried[unit]
    values = {
        "kind": "vector",
        "file": path.name,
        "layers": stated.get("layers"),
        "unit": unit,
        "origin": list(place.origin),
        "snap_m": stated.get("snap_m") or 0.25,
        "seeds_m": [],
    }
    remarks = {
        "layers": "null: all; or a list",
        "unit": f"null: what the file says ({place.unit}); or m, cm, mm, ft, in",
        "origin": "of the mine frame, in the file's coordinates",
        "snap_m": "walls whose ends are nearer than this are joined",
        "seeds_m": "[[x, y], ...] inside the workings, where walls alone do not tell",
    }
    return Detection(values, remarks, [Path(f) for f in vector_files(_vector(path, unit, stated))], width)


def _vector(path: Path, unit: str | None, stated: dict[str, Any]) -> VectorSurveyParams:
    """Return a section that reads a file from wherever it lies, before it is copied below data/."""
    told = {key: stated[key] for key in ("layers", "snap_m") if stated.get(key) is not None}
    section = VectorSurveyParams.model_validate(
        {"kind": "vector", "name": "detect", "file": "data/x", "unit": unit, **told}
    )
    return section.model_copy(update={"file": path.as_posix()})


def _detect_picture(path: Path, stated: dict[str, Any]) -> Detection:
    is_pdf = path.suffix.lower() == ".pdf"
    dpi = float(stated.get("dpi") or 200.0)
    page = int(stated.get("page") or 1)
    picture = draw_page(path, page, dpi, _MEGAPIXELS) if is_pdf else read_image(path, _MEGAPIXELS)
    edge = np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]]).mean(axis=1)
    inverted = bool(np.median(edge) < 128)
    picture = 255 - picture if inverted else picture
    scale, remarks, files = _detect_scale(path, picture, stated)
    drawn = _workings_mask(picture, scale.get("bar_box_px"))
    per_m = scale["px_per_m"] or 0.0
    line_drawing = False
    if scale["source"] == "bar":
        bar = measure_bar(_cut(picture, scale["bar_box_px"]), 1.0, f"{path}")
        line_drawing, width_px = _wall_style(drawn, 0.0)
        length = stated.get("bar_length_m") or min(_BARS_M, key=lambda m: abs(np.log(width_px * m / bar / _LIKELY_M)))
        scale["bar_length_m"], per_m = float(length), bar / length
        how = "stated" if stated.get("bar_length_m") else f"taken, as drifts are then {width_px / per_m:.1f} m wide"
        remarks["scale"] = f"the bar is {bar:.0f} px long; {length:g} m was {how}"
    line_drawing, width_px = _wall_style(drawn, per_m)
    values: dict[str, Any] = {
        "kind": "plan",
        "image": path.name,
        "max_megapixels": _MEGAPIXELS,
        "light_on_dark": inverted,
        "line_drawing": line_drawing,
        "seeds_px": [],
        "wall_gap_px": 3.0,
        "crop_px": None,
        "turn_deg": 0.0,
        "ignore_colours": [],
        **({"page": page, "dpi": dpi} if is_pdf else {}),
        "origin_px": None,
        "scale": scale,
    }
    remarks |= {
        "light_on_dark": "true: light workings on dark paper",
        "line_drawing": "true: walls are drawn as lines, what they enclose is filled",
        "seeds_px": "[[col, row], ...] inside workings drawn as lines; []: what an odd number of walls encloses",
        "wall_gap_px": "gaps in drawn walls up to this are closed",
        "crop_px": "[col0, row0, col1, row1]; null: the whole picture",
        "turn_deg": "counter-clockwise, after cropping",
        "ignore_colours": "[{rgb: [r, g, b], within: 30}, ...]",
        "origin_px": "pixel (col, row) at the mine's origin; null: the south-west corner",
    }
    return Detection(values, remarks, [path, *files], width_px / per_m)


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
    beside = world_file(path)
    if beside is not None or (path.suffix.lower() in (".tif", ".tiff") and _is_placed(path)):
        place = read_placement(path)
        per_m = 1.0 / (place.size * place.metres_per_unit)
        told = f"{per_m:.3f} px/m, as {beside.name if beside else 'the file itself'} says"
        return {**scale, "source": "georeference", "px_per_m": per_m}, {"scale": told}, [beside] if beside else []
    box = stated.get("bar_box_px") or find_bar(picture)
    if box is None:
        raise InputError(
            f"{path}: no scale bar found; state --px-per-m, or --bar-box COL0,ROW0,COL1,ROW1 and --bar-length"
        )
    return {**scale, "bar_box_px": [int(v) for v in box]}, {}, []


def _is_placed(path: Path) -> bool:
    try:
        read_placement(path)
    except InputError as error:
        if "degrees" in str(error):
            raise
        return False
    return True


def _workings_mask(picture: Image, bar_box: list[int] | None) -> Mask:
    dark = dark_pixels(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))
    dark[picture.max(axis=2) - picture.min(axis=2) > 40] = False
    if bar_box is not None:
        dark[bar_box[1] : bar_box[3], bar_box[0] : bar_box[2]] = False
    return dark


def _cut(picture: Image, box: list[int]) -> Image:
    return picture[box[1] : box[3], box[0] : box[2]]


def _wall_style(drawn: Mask, px_per_m: float) -> tuple[bool, float]:
    """Return whether walls are drawn as lines, and the drifts' typical width, px; a scale of 0 is not known yet."""
    stroke = typical_width_px(drawn)
    if stroke >= (WIDTHS_M[0] * px_per_m if px_per_m else _LINE_PX):
        return False, stroke
    try:
        inside = typical_width_px(fill_line_drawing(drawn, [], 3.0))
    except GeometryError:
        return False, stroke
    return inside > 3 * stroke, inside if inside > 3 * stroke else stroke


def typical_width_px(drawn: Mask) -> float:
    """Return the median width of strokes, px: along the middle of its largest piece."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(drawn.astype(np.uint8), connectivity=4)
    if count < 2:
        return 0.0
    largest = np.pad((labels == 1 + stats[1:, cv2.CC_STAT_AREA].argmax()).astype(np.uint8), 1)
    deep = cv2.distanceTransform(largest, cv2.DIST_L2, 5)
    ridge = (deep >= cv2.dilate(deep, np.ones((3, 3)))) & (deep > 0)
    return float(2 * np.median(deep[ridge]))
