"""A mine as its reader has it, and its plan like a published one: grey workings, red labels, a scale bar."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import cv2
import numpy as np
from shapely import MultiPolygon
from shapely.geometry.base import BaseGeometry

from minesurveys.errors import InputError
from minesurveys.frames import Georeference, Heights
from minesurveys.pictures.picture_header import MAX_SIDE_PX
from pipeline.geometry.rasterize import fill_polygon
from pipeline.params.survey.base import DrawnSurveyParams
from pipeline.types import DrawnFloors, DrawnPlan, Frame, Image, Scale, VolumeShape

_OVERSAMPLE = 4
_LETTER_HEIGHT_M = 12.0
WIDEST_M = 20_000.0  # of a survey
_SMALLEST_M = 1.0  # a robot is half as long
_FINEST_PX_PER_M, _WIDEST_PX = 8.0, 6000
_ORIGIN_AT = 0.25  # of a pixel: walls at whole and half metres then miss pixel centres, where rounding would decide
_MAX_PIXELS = 64e6  # drawing fills 16 times as many, because of oversampling


def frame_around(extent_m: tuple[float, float, float, float], px_per_m: float, share: float = 0.5) -> Frame:
    """Return the pixel grid that covers (west, south, east, north), m.

    `share` is the position of the mine's origin inside its pixel: 0.5 is the pixel's centre.
    """
    west, south, east, north = extent_m
    left, above = int(np.ceil(-west * px_per_m - share)), int(np.ceil(north * px_per_m - share))
    right, below = int(np.ceil(east * px_per_m + share)), int(np.ceil(-south * px_per_m + share))
    if (left + right) * (above + below) > _MAX_PIXELS or max(left + right, above + below) > MAX_SIDE_PX:
        raise InputError(
            f"survey.px_per_m = {px_per_m:g}: the plan would have {left + right} x {above + below} pixels "
            f"(at most {_MAX_PIXELS:.0f}, {MAX_SIDE_PX} a side)"
        )
    return Frame(px_per_m, left + share, above + share, left + right, above + below)


def frame_of(name: str, workings: BaseGeometry, params: DrawnSurveyParams, size_by: str = "survey.unit") -> Frame:
    """Return the pixel grid of the drawing of a survey in metres; errors have its `name` and what states its size.

    Raises
    ------
    InputError
        If the workings are longer than 20 km or shorter than 1 m.
    """
    west, south, east, north = workings.bounds
    m = params.margin_m
    widest = max(east - west, north - south) + 2 * m
    if widest > WIDEST_M:
        raise InputError(
            f"{name}: the workings extend over {widest:.0f} m, the limit is {WIDEST_M:,.0f} m; is {size_by} right?"
        )
    if max(east - west, north - south) < _SMALLEST_M:
        raise InputError(
            f"{name}: the workings are {max(east - west, north - south):.2g} m long, at least "
            f"{_SMALLEST_M:g} m is needed; is {size_by} right?"
        )
    per_m = params.px_per_m or min(_FINEST_PX_PER_M, _WIDEST_PX / widest)
    return frame_around((west - m, south - m, east + m, north + m), per_m, _ORIGIN_AT)


@dataclass(frozen=True)
class MineReading:
    """A mine as its reader has it.

    `workings` (m, mine frame) are the view from above of a shape that is no plan; None of a picture, which stage 2
    traces. `draw_plan` draws the plan, in `frame`. `files` are those that were read. Of a picture `scale` is how it was
    measured, and `boxes` (px) show no workings.
    """

    workings: MultiPolygon | None
    georeference: Georeference
    frame: Frame
    draw_plan: partial[Image]  # one of 6,000 px takes 2 s, and detection needs none
    heights: Heights | None = None
    shape: DrawnPlan | VolumeShape = field(default_factory=DrawnPlan)
    files: list[str] = field(default_factory=list)
    scale: Scale | None = None
    boxes: list[tuple[int, int, int, int]] = field(default_factory=list)

    @property
    def width_m(self) -> float:
        """Return the typical width of the drifts: that of one long drift of the same area and length of walls."""
        if isinstance(self.shape, DrawnFloors):
            return self.shape.mesh.width_m
        return 2 * self.workings.area / self.workings.length if self.workings else math.nan

    @property
    def has_heights(self) -> bool:
        """Return whether the survey states where its floors are."""
        return self.heights is not None or not isinstance(self.shape, DrawnPlan)

    @property
    def walls_m(self) -> float:
        """Return the length of all walls seen from above, those over each other among them."""
        if isinstance(self.shape, DrawnFloors):
            return self.shape.mesh.walls_m
        return float(self.workings.length) if self.workings else 0.0


def reading_of(
    name: str,
    workings: MultiPolygon,
    params: DrawnSurveyParams,
    georeference: Georeference,
    size_by: str = "survey.unit",
    **more: Any,
) -> MineReading:
    """Return the reading of workings (m, mine frame) with the frame of their drawing; `more` are its other fields.

    Raises
    ------
    InputError
        If the workings have no area, or as of `frame_of`.
    """
    if workings.is_empty:
        raise InputError(f"{name}: the workings have no area")
    frame = frame_of(name, workings, params, size_by)
    draw = partial(draw_workings, workings, frame, params.labels_m, params.drawing_grey)
    return MineReading(workings, georeference, frame, draw, **more)


def draw_workings(
    workings: BaseGeometry, frame: Frame, labels_m: dict[str, tuple[float, float]], drawing_grey: int
) -> Image:
    """Draw workings (m, mine frame) and labels as (rows, cols, 3) uint8 BGR, anti-aliased by area."""
    grey = 255 - np.round(_cover(workings, frame).astype(np.float32) / 255 * (255 - drawing_grey)).astype(np.uint8)
    plan = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
    for text, centre_m in labels_m.items():
        _draw_label(plan, text, frame, centre_m)
    return plan


def draw_picture(
    workings: BaseGeometry, frame: Frame, drawing_grey: int, anti_aliased: bool, jpeg_quality: int | None
) -> Image:
    """Draw workings (m, mine frame) as a plan's picture (rows, cols, 3) uint8 BGR, with or without its usual defects.

    Parameters
    ----------
    workings : shapely geometry, m, mine frame
    frame : Frame
    drawing_grey : int
        Grey value of the workings.
    anti_aliased : bool
        Shade pixels by the share that the workings cover; else by their centres.
    jpeg_quality : int or None
        Compress and decompress the picture; None leaves it as it is.
    """
    if anti_aliased:
        plan = draw_workings(workings, frame, {}, drawing_grey)
    else:
        grey = np.where(fill_polygon(workings, frame), drawing_grey, 255).astype(np.uint8)
        plan = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
    if jpeg_quality is None:
        return plan
    data = cv2.imencode(".jpg", plan, [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality])[1]
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR))


def _cover(workings: BaseGeometry, frame: Frame) -> np.ndarray:
    """Return the share of workings in each pixel as (rows, cols) uint8; 255 means the whole pixel."""
    fine = replace(
        frame,
        px_per_m=frame.px_per_m * _OVERSAMPLE,
        origin_col=frame.origin_col * _OVERSAMPLE,
        origin_row=frame.origin_row * _OVERSAMPLE,
        width_px=frame.width_px * _OVERSAMPLE,
        height_px=frame.height_px * _OVERSAMPLE,
    )
    size = (frame.width_px, frame.height_px)
    return cv2.resize(fill_polygon(workings, fine).astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA)


def draw_plan(
    workings: BaseGeometry,
    frame: Frame,
    labels_m: dict[str, tuple[float, float]],
    bar_length_m: float,
    drawing_grey: int,
) -> tuple[Image, tuple[int, int, int, int]]:
    """Draw the plan.

    Parameters
    ----------
    workings : shapely geometry, m, mine frame
    frame : Frame
    labels_m : dict
        Label text to its centre, m, mine frame.
    bar_length_m : float
        Length of the scale bar. The bar is drawn in the first corner without workings, bottom left first.
    drawing_grey : int
        Grey value of the workings.

    Returns
    -------
    (rows, cols, 3) uint8
        BGR, anti-aliased by area.
    (col0, row0, col1, row1)
        The scale bar's box, px.

    Raises
    ------
    InputError
        If no corner has room for the bar.
    """
    plan, cover = draw_workings(workings, frame, labels_m, drawing_grey), _cover(workings, frame)
    box = _draw_bar(plan, cover, round(bar_length_m * frame.px_per_m), frame.px_per_m)
    return plan, box


def _draw_label(plan: np.ndarray, text: str, frame: Frame, centre_m: tuple[float, float]) -> None:
    scale = cv2.getFontScaleFromHeight(cv2.FONT_HERSHEY_SIMPLEX, max(8, round(_LETTER_HEIGHT_M * frame.px_per_m)))
    thickness = max(1, round(frame.px_per_m * 1.2))
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, thickness)
    col, row = frame.to_image(np.array([centre_m]))[0]
    corner = (round(col - width / 2), round(row + height / 2))
    cv2.putText(plan, text, corner, cv2.FONT_HERSHEY_SIMPLEX, scale, (0, 0, 255), thickness, cv2.LINE_AA)


def _draw_bar(plan: np.ndarray, cover: np.ndarray, length_px: int, px_per_m: float) -> tuple[int, int, int, int]:
    rows, cols = cover.shape
    thick, gap = max(3, round(3.0 * px_per_m)), max(4, round(2.0 * px_per_m))
    width, height = length_px + 2 * gap, thick + 2 * gap
    for row0 in (rows - height, 0):
        for col0 in (0, cols - width):
            if row0 < 0 or col0 < 0:
                continue
            area = np.s_[row0 : row0 + height, col0 : col0 + width]
            if not cover[area].any() and (plan[area] == 255).all():
                plan[row0 + gap : row0 + gap + thick, col0 + gap : col0 + gap + length_px] = 0
                return col0, row0, col0 + width, row0 + height
    raise InputError(
        f"survey: no corner of the {cols} x {rows} px plan has room for a scale bar of {length_px} px; "
        "widen survey.margin_m or shorten survey.scale.bar_length_m"
    )
