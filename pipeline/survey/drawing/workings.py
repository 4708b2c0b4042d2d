"""Decide how a plan's picture shows its workings: filled, as lines, or among other things on a drawing."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from minesurveys.errors import DoubtError, GeometryError, InputError
from minesurveys.remarks import warn_user
from pipeline.geometry.drawing.bounded import read_bounded, share_of
from pipeline.geometry.drawing.doubts import DrawingError
from pipeline.geometry.drawing.fills import find_ink
from pipeline.geometry.drawing.line_drawing import fill_line_drawing
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import PlanSurveyParams
from pipeline.survey.drawing.reduction import Box, place_in, size_read
from pipeline.types import Image, Mask

WIDTHS_M = (1.5, 12.0)  # range of drift widths in practice
LIKELY_M = 5.5  # usual width of a mechanized drift; that of the published mine at scan 02S
_LINE_PX = 6.0  # widest stroke of a line drawing if the scale is unknown
_SAME = 0.97  # IoU of two readings that agree
_FEW = 15  # pieces of ink beside the workings of a clean plan
_PIECE_PX = 6
_TINT = np.array([40, 160, 40])  # BGR


@dataclass(frozen=True)
class FoundWorkings:
    """The workings in a picture, their typical width, and how stage 1 must read them."""

    mask: Mask
    width_px: float
    line_drawing: bool = False
    workings_only: bool = False


def find_workings(
    path: Path, picture: Image, dark: Mask, px_per_m: float, stated: StatedOptions, reduction: int = 1
) -> FoundWorkings:
    """Find the workings of a plan, dark on light.

    A plan that shows nothing but workings is read as a whole. If there is more, it is read as a drawing; such a reading
    that agrees with the whole confirms the simpler one.

    Parameters
    ----------
    path : Path
    picture : (rows, cols, 3) uint8
    dark : (rows, cols) bool
        Dark, colourless pixels outside the scale bar.
    px_per_m : float
        0 if unknown.
    stated : StatedOptions
        `level`, `seeds_px` and `wall_gap_px`, px of the whole picture; with seeds the picture is a line drawing.
    reduction : int
        How much smaller the picture is than the whole.

    Raises
    ------
    DoubtError
        If the picture shows more than workings and they are not found beyond doubt.
    InputError
        If a seed is outside the walls, or they enclose nothing.
    """
    seeds = [place_in(seed, reduction) for seed in stated.seeds_px or []]
    gap_px = wall_gap_px(stated) / reduction
    if seeds:
        try:
            mask = fill_line_drawing(dark, seeds, gap_px)
        except GeometryError as error:
            raise InputError(f"{path}: {error}{size_read(reduction)}") from error
        return FoundWorkings(mask, typical_width_px(mask), line_drawing=True)
    whole = _read_whole(dark, px_per_m, gap_px)
    if _is_clean(picture, whole.mask):
        return whole
    try:
        drawing = read_bounded(picture, stated.level, reduction)
    except GeometryError as error:
        found = error.found if isinstance(error, DrawingError) else None
        raise DoubtError(f"{path}: {error}", draw_detected(picture, found, None)) from error
    if (share := share_of(picture)) < 1.0:
        shown = f"{100 * share / reduction:.0f} %"
        warn_user(
            f"the workings are found at {shown} of the picture's size",
            of=path.name,
            option="--crop",
            advice="--crop keeps more",
        )
    if (drawing.mask & whole.mask).sum() >= _SAME * (drawing.mask | whole.mask).sum():
        return whole
    return FoundWorkings(drawing.mask, drawing.width_px, workings_only=True)


def wall_gap_px(stated: StatedOptions) -> float:
    """Return the widest gap in drawn walls that is closed, px: the stated one, which may be 0, else the schema's."""
    given = stated.wall_gap_px
    return float(PlanSurveyParams.model_fields["wall_gap_px"].default) if given is None else given


def draw_detected(picture: Image, mask: Mask | None, bar_box: Box | None) -> Image:
    """Draw a picture pale, the workings green, the box round them (a crop) and the scale bar's box red."""
    shown = 255 - (255 - picture) // 2  # of a picture of 200 megapixels an array of 16 bits has 1.2 GB
    line = max(1, round(max(picture.shape[:2]) / 600))
    boxes = [bar_box]
    if mask is not None and mask.any():
        shown[mask] = (shown[mask] * 0.35 + _TINT * 0.65).astype(np.uint8)
        col, row, cols, rows = cv2.boundingRect(mask.astype(np.uint8))
        boxes.append((col, row, col + cols, row + rows))
    for box in boxes:
        if box is not None:
            cv2.rectangle(shown, (int(box[0]), int(box[1])), (int(box[2]) - 1, int(box[3]) - 1), (40, 40, 220), line)
    return shown


def _is_clean(picture: Image, whole: Mask) -> bool:
    """Return whether a picture shows little beside its workings: labels and a scale bar."""
    beside = find_ink(picture) & ~(cv2.dilate(whole.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0)
    _, _, stats, _ = cv2.connectedComponentsWithStats(beside.astype(np.uint8), connectivity=8)
    rows, cols = whole.shape
    pieces = stats[1:][stats[1:, cv2.CC_STAT_AREA] >= _PIECE_PX]
    long = (pieces[:, 2] > 0.6 * cols) | (pieces[:, 3] > 0.6 * rows)
    return len(pieces) <= _FEW and not long.any()


def _read_whole(dark: Mask, px_per_m: float, gap_px: float) -> FoundWorkings:
    """Read a plan that shows nothing but workings, filled or as lines that enclose them. A scale of 0 means unknown."""
    stroke = typical_width_px(dark)
    filled = FoundWorkings(_largest(dark), stroke)
    if stroke >= (WIDTHS_M[0] * px_per_m if px_per_m else _LINE_PX):
        return filled
    try:
        mask = fill_line_drawing(dark, [], gap_px)
    except GeometryError:
        return filled
    inside = typical_width_px(mask)
    return FoundWorkings(mask, inside, line_drawing=True) if inside > 3 * stroke else filled


def typical_width_px(mask: Mask) -> float:
    """Return the median width, px, along the middle of a mask's largest component."""
    if not mask.any():
        return 0.0
    distance = cv2.distanceTransform(np.pad(_largest(mask).astype(np.uint8), 1), cv2.DIST_L2, 5)
    ridge = (distance >= cv2.dilate(distance, np.ones((3, 3)))) & (distance > 0)
    return float(2 * np.median(distance[ridge]))


def _largest(mask: Mask) -> Mask:
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    return np.asarray(labels == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())) if count > 1 else mask
