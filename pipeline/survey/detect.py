"""Detect the kind, scale, unit and style of a survey file."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pipeline.errors import GeometryError, InputError
from pipeline.geometry.binarize import dark_pixels
from pipeline.geometry.line_drawing import fill_line_drawing
from pipeline.params.reader_limits import reader_limits
from pipeline.params.survey import PassageSurveyParams, VectorSurveyParams
from pipeline.survey.child import Payload, run_limited
from pipeline.survey.formats import PASSAGE_READERS, SHAPE_READERS
from pipeline.survey.georeference import read_placement, world_file
from pipeline.survey.grid import draw_grid
from pipeline.survey.image import read_image
from pipeline.survey.nav2 import nav2_picture
from pipeline.survey.picture import draw_page, require_few_regions
from pipeline.survey.scale import find_bar, measure_bar
from pipeline.survey.shapes import METRES
from pipeline.survey.solved.read import SOLVED_SUFFIXES
from pipeline.survey.vector_survey import draw_vector_survey, read_shapes, vector_files
from pipeline.types import Image, Mask

PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pdf")
WIDTHS_M = (1.5, 12.0)  # range of drift widths in practice
_LIKELY_M = 5.5  # usual width of a mechanized drift; that of the published mine at scan 02S
_BARS_M = (10.0, 20.0, 25.0, 50.0, 100.0, 200.0, 250.0, 500.0, 1000.0)
_LINE_PX = 6.0  # widest stroke of a line drawing if the scale is unknown


@dataclass(frozen=True)
class Detection:
    """Values and remarks of a survey section, its files, the typical drift width, m, and whether it has heights."""

    values: dict[str, Any]
    remarks: dict[str, str] = field(default_factory=dict)
    files: list[Path] = field(default_factory=list)
    width_m: float = 0.0
    has_heights: bool = False


def detect_survey(path: Path, stated: dict[str, Any]) -> Detection:
    """Detect how a file should be read, in a process with the limits of `conf/reader_limits.yaml`.

    Parameters
    ----------
    path : Path
        Any file that stage 1 reads, in any folder.
    stated : dict
        The user's values of `px_per_m`, `bar_length_m`, `bar_box_px`, `unit`, `layers`, `snap_m`, `page`, `dpi`.

    Returns
    -------
    Detection

    Raises
    ------
    InputError
        If the file does not exist, its format is not supported, or its scale cannot be found. The message names the
        option that states the scale.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    scratch = path.suffix.lower() in SOLVED_SUFFIXES
    found = run_limited("detect", {"path": str(path), "stated": stated}, str(path), scratch=scratch).values
    files = [Path(file) for file in found["files"]]
    return Detection(found["values"], found["remarks"], files, found["width_m"], found["has_heights"])


def detect_here(path: str, stated: dict[str, Any]) -> Payload:
    """Detect how a file should be read in this process; `detect_survey` has limits."""
    found = _detect(Path(path), stated)
    files = [str(file) for file in found.files]
    return Payload({**vars(found), "files": files})


def _detect(path: Path, stated: dict[str, Any]) -> Detection:
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
        params = PassageSurveyParams(kind="passages", name="detect", file="data/x", heights=None)
        params = params.model_copy(update={"file": path.as_posix()})
        workings, place, _, _, heights = draw_vector_survey(params)
        values = {"kind": "passages", "file": path.name, "origin": list(place.origin)}
        remarks = {"origin": "of the mine frame, in the file's coordinates"}
        width = 2 * workings.area / workings.length
        return Detection(values, remarks, [Path(f) for f in vector_files(params)], width, heights is not None)
    supported = ", ".join([*PICTURE_SUFFIXES, ".yaml", *SHAPE_READERS, *PASSAGE_READERS])
    raise InputError(f"{path}: {suffix or 'a file without a suffix'} is not a supported format ({supported})")


def _detect_vector(path: Path, stated: dict[str, Any]) -> Detection:
    """Use the unit that the file names, or the unit in which the drifts have a plausible width."""
    tried: dict[str | None, tuple[float, Any]] = {}
    units = [stated["unit"]] if stated.get("unit") else [None, *METRES]
    problem: InputError | None = None
    content = read_shapes(path, stated.get("layers"))
    for unit in units:
        params = _vector(path, unit, stated)
        try:
            workings, place, *_ = draw_vector_survey(params, content)
        except InputError as error:
            problem = problem or error
            continue
        tried[unit] = 2 * workings.area / workings.length, place
        if unit is None and WIDTHS_M[0] <= tried[None][0] <= WIDTHS_M[1]:
            break
    if not tried:
        raise problem or InputError(f"{path}: has no workings")
    keeps_unit = None in tried and (WIDTHS_M[0] <= tried[None][0] <= WIDTHS_M[1] or tried[None][1].crs is not None)
    unit = None if keeps_unit else min(tried, key=lambda u: abs(np.log(tried[u][0] / _LIKELY_M)))
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
        "layers": "null: all layers; or a list",
        "unit": f"null: the file's unit ({place.unit}); or m, cm, mm, ft, in",
        "origin": "of the mine frame, in the file's coordinates",
        "snap_m": "wall ends closer than this are joined",
        "seeds_m": "[[x, y], ...] points inside the workings, if the walls enclose other areas too",
    }
    return Detection(values, remarks, [Path(f) for f in vector_files(_vector(path, unit, stated))], width)


def _vector(path: Path, unit: str | None, stated: dict[str, Any]) -> VectorSurveyParams:
    """Return a survey section for a file in any folder, before it is copied below data/."""
    options = {key: stated[key] for key in ("layers", "snap_m") if stated.get(key) is not None}
    section = VectorSurveyParams.model_validate(
        {"kind": "vector", "name": "detect", "file": "data/x", "unit": unit, **options}
    )
    return section.model_copy(update={"file": path.as_posix()})


def _detect_picture(path: Path, stated: dict[str, Any]) -> Detection:
    is_pdf = path.suffix.lower() == ".pdf"
    dpi = float(stated.get("dpi") or 200.0)
    page, most = int(stated.get("page") or 1), reader_limits().megapixels
    if not 36 <= dpi <= 1200:
        raise InputError(f"{path}: --dpi = {dpi:g}, the limits are 36 and 1200")
    picture = draw_page(path, page, dpi, most) if is_pdf else read_image(path, most)
    edge = np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]]).mean(axis=1)
    inverted = bool(np.median(edge) < 128)
    picture = 255 - picture if inverted else picture
    require_few_regions(path, picture)
    scale, remarks, files = _detect_scale(path, picture, stated)
    dark = _workings_mask(picture, scale.get("bar_box_px"))
    per_m = scale["px_per_m"] or 0.0
    line_drawing = False
    if scale["source"] == "bar":
        bar = measure_bar(_cut(picture, scale["bar_box_px"]), 1.0, f"{path}")
        line_drawing, width_px = _wall_style(dark, 0.0)
        length = stated.get("bar_length_m") or min(_BARS_M, key=lambda m: abs(np.log(width_px * m / bar / _LIKELY_M)))
        scale["bar_length_m"], per_m = float(length), bar / length
        drift_m = width_px / per_m
        reason = "as stated" if stated.get("bar_length_m") else f"detected: drifts are then {drift_m:.1f} m wide"
        remarks["scale"] = f"the bar is {bar:.0f} px long and represents {length:g} m ({reason})"
    line_drawing, width_px = _wall_style(dark, per_m)
    values: dict[str, Any] = {
        "kind": "plan",
        "image": path.name,
        "max_megapixels": most,
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
        "line_drawing": "true: walls are drawn as lines; the areas that they enclose are filled",
        "seeds_px": "[[col, row], ...] points inside drawn workings; []: areas inside an odd number of walls",
        "wall_gap_px": "gaps in drawn walls up to this width are closed",
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
    file = world_file(path)
    if file is not None or (path.suffix.lower() in (".tif", ".tiff") and _has_georeference(path)):
        place = read_placement(path)
        per_m = 1.0 / (place.size * place.metres_per_unit)
        remark = f"{per_m:.3f} px/m from {file.name if file else 'the file itself'}"
        return {**scale, "source": "georeference", "px_per_m": per_m}, {"scale": remark}, [file] if file else []
    box = stated.get("bar_box_px") or find_bar(picture)
    if box is None:
        raise InputError(
            f"{path}: no scale bar found; state --px-per-m, or --bar-box COL0,ROW0,COL1,ROW1 and --bar-length"
        )
    return {**scale, "bar_box_px": [int(v) for v in box]}, {}, []


def _has_georeference(path: Path) -> bool:
    try:
        read_placement(path)
    except InputError as error:
        if "degrees" in str(error):
            raise
        return False
    return True


def _workings_mask(picture: Image, bar_box: list[int] | None) -> Mask:
    """Return the dark, colourless pixels outside the scale bar's box."""
    dark = dark_pixels(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))
    dark[picture.max(axis=2) - picture.min(axis=2) > 40] = False
    if bar_box is not None:
        dark[bar_box[1] : bar_box[3], bar_box[0] : bar_box[2]] = False
    return dark


def _cut(picture: Image, box: list[int]) -> Image:
    return picture[box[1] : box[3], box[0] : box[2]]


def _wall_style(dark: Mask, px_per_m: float) -> tuple[bool, float]:
    """Return whether walls are drawn as lines, and the typical drift width, px. A scale of 0 means unknown."""
    stroke = typical_width_px(dark)
    if stroke >= (WIDTHS_M[0] * px_per_m if px_per_m else _LINE_PX):
        return False, stroke
    try:
        inside = typical_width_px(fill_line_drawing(dark, [], 3.0))
    except GeometryError:
        return False, stroke
    return inside > 3 * stroke, inside if inside > 3 * stroke else stroke


def typical_width_px(mask: Mask) -> float:
    """Return the median width, px, along the middle of a mask's largest component."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    if count < 2:
        return 0.0
    largest = np.pad((labels == 1 + stats[1:, cv2.CC_STAT_AREA].argmax()).astype(np.uint8), 1)
    distance = cv2.distanceTransform(largest, cv2.DIST_L2, 5)
    ridge = (distance >= cv2.dilate(distance, np.ones((3, 3)))) & (distance > 0)
    return float(2 * np.median(distance[ridge]))
