"""Detect the scale of a plan's picture and how its workings are drawn."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from pydantic import ValidationError

from minesurveys.errors import DoubtError, InputError
from minesurveys.formats import FileKind, kind_of
from minesurveys.limits import reader_limits
from minesurveys.pictures.georeference import find_placement, placement_files
from minesurveys.pictures.image import read_image
from minesurveys.pictures.pages import USUAL_DPI, OpenPage, open_page
from minesurveys.pictures.paper_scale import px_per_m_of, ratio_in
from minesurveys.refusals import in_own_words
from pipeline.geometry.outline.binarize import dark_pixels
from pipeline.params.stated import StatedOptions, option
from pipeline.params.survey import PlanSurveyParams
from pipeline.survey.detection.detected_section import Detection
from pipeline.survey.drawing.light import BETTER_LIGHT, is_light_on_dark
from pipeline.survey.drawing.picture import make_ready, require_few_regions
from pipeline.survey.drawing.reduction import Box, box_in, fitting_reduction
from pipeline.survey.drawing.scale import find_bar, measure_bar
from pipeline.survey.drawing.workings import LIKELY_M, draw_detected, find_workings, wall_gap_px
from pipeline.types import Image, Mask

_IN_PX = ("px_per_m", "bar_box_px", "crop_px", "seeds_px", "wall_gap_px")
_BARS_M = (10.0, 20.0, 25.0, 50.0, 100.0, 200.0, 250.0, 500.0, 1000.0)


def detect_picture(path: Path, stated: StatedOptions) -> Detection:
    """Detect the scale of a plan's picture, or of a page of a PDF, and how its workings are drawn.

    Raises
    ------
    InputError
        If the file cannot be read, has no scale, or a stated value is refused; of workings that are not found beyond
        doubt a `DoubtError`.
    """
    is_pdf, most = kind_of(path) is FileKind.PDF, reader_limits().megapixels
    page, dpi, text = int(stated.page or 1), 0.0, ""
    if is_pdf:
        with open_page(path, page) as opened:
            dpi = stated.dpi or _fitting_dpi(opened, stated)
            image, text = opened.render(dpi, most), opened.text()
    else:
        image = read_image(path, most)
    picture, evened, section = _ready_picture(path, stated, image)
    by = section["reduction"]
    require_few_regions(path, picture)
    scale, remarks, files = _detect_scale(path, picture, by, stated, (text, dpi) if is_pdf else None)
    box = None if scale["bar_box_px"] is None else box_in(scale["bar_box_px"], by)
    dark = _workings_mask(picture, box)
    per_m = (scale["px_per_m"] or 0.0) / by
    with _advice_on_light(evened):
        found = find_workings(path, picture, dark, per_m, stated, by)
        if box is not None:
            per_m = _read_bar(path, _cut(picture, box), by, found.width_px, scale, remarks, stated)
            if not found.workings_only:  # strokes count as drifts from a width in metres on
                found = find_workings(path, picture, dark, per_m, stated, by)
    width_px = found.width_px
    values: dict[str, Any] = {
        "kind": "plan",
        "image": path.name,
        "max_megapixels": most,
        "light_on_dark": section["light_on_dark"],
        "workings_only": found.workings_only,
        "level": stated.level,
        "line_drawing": found.line_drawing,
        "seeds_px": stated.seeds_px or [],
        "wall_gap_px": wall_gap_px(stated),
        "crop_px": stated.crop_px,
        **({"reduction": by} if by > 1 else {}),
        "turn_deg": 0.0,
        "ignore_colours": section["ignore_colours"],
        **({"page": page, "dpi": dpi} if is_pdf else {}),
        "origin_px": None,
        "scale": scale,
    }
    remarks |= {
        "workings_only": "true: a drawing, of which only what looks like workings is kept",
        "level": "which plan of several on the drawing, from 1",
        "light_on_dark": "true: light workings on dark paper",
        "line_drawing": "true: walls are drawn as lines; the areas that they enclose are filled",
        "seeds_px": "[[col, row], ...] points inside drawn workings; []: areas inside an odd number of walls",
        "wall_gap_px": "gaps in drawn walls up to this width are closed",
        "crop_px": "[col0, row0, col1, row1]; null: the whole picture",
        "reduction": f"read at 1/{by} of its size; values in px are those of the whole; 1 needs more time and memory",
        "turn_deg": "counter-clockwise, after cropping",
        "ignore_colours": "[{rgb: [r, g, b], within: 30}, ...]",
        "origin_px": "pixel (col, row) at the mine's origin; null: the south-west corner",
    }
    shown = draw_detected(picture, found.mask, box)
    return Detection(values, remarks, [path, *files], width_px / per_m, shown)


@contextmanager
def _advice_on_light(evened: bool) -> Iterator[None]:
    """Add to a doubt about a picture in uneven light that a scan would settle it."""
    try:
        yield
    except DoubtError as doubt:
        if not evened:
            raise
        raise DoubtError(f"{doubt}{BETTER_LIGHT}", doubt.picture) from doubt


def _ready_picture(path: Path, stated: StatedOptions, picture: Image) -> tuple[Image, bool, dict[str, Any]]:
    """Return a picture, or a page, dark on light and of a size that can be searched.

    Also return whether its light was evened out, and the section of what was done.
    """
    left, top, right, bottom = stated.crop_px or (0, 0, picture.shape[1], picture.shape[0])
    section = {
        "crop_px": stated.crop_px,
        "ignore_colours": [{"rgb": rgb} for rgb in stated.ignore_colours or []],
        "light_on_dark": is_light_on_dark(picture),
        "reduction": fitting_reduction(right - left, bottom - top),
    }
    return *make_ready(path, picture, _picture_section(section)), section


def _fitting_dpi(page: OpenPage, stated: StatedOptions) -> float:
    """Return the resolution of a page for which none is stated; values in pixels need the usual one."""
    dpi = page.fitting_dpi()
    in_px = [option(name).flags[0] for name in _IN_PX if getattr(stated, name) is not None]
    if dpi != USUAL_DPI and in_px:
        raise InputError(f"{page.path}: {in_px[0]} depends on the resolution; state --dpi too, {dpi:g} or less fits")
    return dpi


def _picture_section(values: dict[str, Any]) -> PlanSurveyParams:
    base = {"kind": "plan", "name": "detect", "image": "data/x", "max_megapixels": reader_limits().megapixels}
    try:
        return PlanSurveyParams.model_validate({**base, "scale": {"source": "stated", "px_per_m": 1.0}, **values})
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise InputError(f"survey.{where} = {first['input']!r}: {in_own_words(first)}") from error


def _read_bar(
    path: Path,
    bar_alone: Image,
    by: int,
    width_px: float,
    scale: dict[str, Any],
    remarks: dict[str, str],
    stated: StatedOptions,
) -> float:
    """Measure the bar in a picture reduced by `by`, state its length in `scale` and `remarks`, and return px/m."""
    bar = measure_bar(bar_alone, 1.0, f"{path}")
    length = stated.bar_length_m or min(_BARS_M, key=lambda m: abs(np.log(width_px * m / bar / LIKELY_M)))
    scale["bar_length_m"] = float(length)
    reason = "as stated" if stated.bar_length_m else f"detected: drifts are then {width_px * length / bar:.1f} m wide"
    remarks["scale"] = f"the bar is {by * bar:.0f} px long and represents {length:g} m ({reason})"
    return float(bar / length)


def _detect_scale(
    path: Path, picture: Image, by: int, stated: StatedOptions, of_page: tuple[str, float] | None
) -> tuple[dict[str, Any], dict[str, str], list[Path]]:
    """Return the scale of the whole of a picture, which is reduced by `by`, remarks on the scale, and its files.

    `of_page` is the text and the resolution of a PDF's page.
    """
    scale: dict[str, Any] = {
        "source": "bar",
        "bar_box_px": None,
        "bar_length_m": 100.0,
        "bar_image": None,
        "px_per_m": None,
    }
    if stated.px_per_m:
        return {**scale, "source": "stated", "px_per_m": stated.px_per_m}, {"scale": "stated"}, []
    dpi = None if of_page is None else of_page[1]
    if stated.ratio:
        per_m = px_per_m_of(path, stated.ratio, dpi)
        return {**scale, "source": "stated", "px_per_m": per_m}, {"scale": f"1:{stated.ratio:g} as stated"}, []
    if (place := find_placement(path)) is not None:
        files = placement_files(path)
        per_m = 1.0 / (place.size * place.metres_per_unit)
        remark = f"{per_m:.3f} px/m from {files[0].name if files else 'the file itself'}"
        if place.unit in ("m", "metre") and abs(place.metres_per_unit - 1) > 1e-6:
            remark += f", whose metre is {place.metres_per_unit:.4f} m on the ground ({place.crs})"
        return {**scale, "source": "georeference", "px_per_m": per_m}, {"scale": remark}, files
    box = _stated_box(path, picture, by, stated)
    if box is None and (found := find_bar(picture)) is not None:
        box = tuple(by * side for side in found)
    ratio = ratio_in(of_page[0]) if box is None and of_page is not None else None
    if ratio is not None:
        remark = f"1:{ratio:g} by the text of the page, if it is printed in its own size; else --scale 1:N"
        return {**scale, "source": "stated", "px_per_m": px_per_m_of(path, ratio, dpi)}, {"scale": remark}, []
    if box is None:
        raise InputError(
            f"{path}: no scale bar found; state --px-per-m, --scale 1:N of the paper, or --bar-box COL0,ROW0,COL1,ROW1 "
            "round a bar, or a line with ticks at its ends, and --bar-length"
        )
    return {**scale, "bar_box_px": [int(v) for v in box]}, {}, []


def _stated_box(path: Path, picture: Image, by: int, stated: StatedOptions) -> tuple[float, ...] | None:
    """Return the stated box of the scale bar; refuse one that is not inside the picture."""
    box = stated.bar_box_px
    rows, cols = by * picture.shape[0], by * picture.shape[1]
    if box is not None and not (0 <= box[0] < box[2] <= cols and 0 <= box[1] < box[3] <= rows):
        stated_box = ", ".join(f"{value:g}" for value in box)
        raise InputError(f"{path}: --bar-box = [{stated_box}]: not inside the picture of {cols} x {rows} px")
    return box


def _workings_mask(picture: Image, bar_box: Box | None) -> Mask:
    """Return the dark, colourless pixels outside the scale bar's box."""
    dark = dark_pixels(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))
    blue, green, red = cv2.split(picture)  # the greatest channel of a row in NumPy takes five times as long
    chroma = cv2.subtract(cv2.max(cv2.max(blue, green), red), cv2.min(cv2.min(blue, green), red))
    dark[chroma > 40] = False
    if bar_box is not None:
        dark[bar_box[1] : bar_box[3], bar_box[0] : bar_box[2]] = False
    return dark


def _cut(picture: Image, box: Box) -> Image:
    return picture[box[1] : box[3], box[0] : box[2]]
