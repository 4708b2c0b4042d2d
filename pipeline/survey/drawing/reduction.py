"""Read a large picture at a whole-number part of its size. Values in px stay those of the picture as it is stored."""

from __future__ import annotations

import math
from collections.abc import Iterable

import cv2
import numpy as np

from pipeline.params.survey import PlanSurveyParams
from pipeline.types import Image

FITTING_PX = 50e6  # what is read whole: 200 megapixels, the limit, are halved and then need 15 s and 1.5 GB
_STRIP_ROWS = 512

Place = tuple[float, float]
Box = tuple[int, int, int, int]


def fitting_reduction(width: int, height: int) -> int:
    """Return by how much a picture, or its crop, of a size in px is reduced if nothing is stated; 1 is not at all."""
    return math.ceil(math.sqrt(width * height / FITTING_PX))


def reduce_picture(picture: Image, by: int) -> Image:
    """Return a picture whose pixels are the means of `by` x `by` pixels; the last ones repeat the border."""
    if by == 1:
        return picture
    rows, cols = (math.ceil(side / by) for side in picture.shape[:2])
    result = np.empty((rows, cols, 3), np.uint8)
    strip_rows = max(1, _STRIP_ROWS // by)
    for row in range(0, rows, strip_rows):
        part = picture[row * by : (row + strip_rows) * by]
        below, right = -len(part) % by, -part.shape[1] % by
        part = cv2.copyMakeBorder(part, 0, below, 0, right, cv2.BORDER_REPLICATE) if below or right else part
        size = (cols, len(part) // by)
        result[row : row + strip_rows] = cv2.resize(part, size, interpolation=cv2.INTER_AREA)
    return result


def box_in(box: Iterable[float], by: int) -> Box:
    """Return the box (col0, row0, col1, row1) of a reduced picture that holds one of the whole picture."""
    col0, row0, col1, row1 = box
    return math.floor(col0 / by), math.floor(row0 / by), math.ceil(col1 / by), math.ceil(row1 / by)


def place_in(place: Place, by: int) -> Place:
    """Return a pixel (col, row) of the whole picture as one of a reduced picture; a pixel is named by its centre."""
    return (place[0] + 0.5) / by - 0.5, (place[1] + 0.5) / by - 0.5


def in_reduced_px(params: PlanSurveyParams) -> PlanSurveyParams:
    """Return the parameters that are used after the crop and the turn, in px of the reduced picture.

    A scale with `resample_width_px` is that of the resampled picture, and stays.
    """
    by, scale, poses = params.reduction, params.scale, params.poses
    if by == 1:
        return params
    per_m = scale.px_per_m if params.resample_width_px or scale.px_per_m is None else scale.px_per_m / by
    box = None if scale.bar_box_px is None else box_in(scale.bar_box_px, by)
    if poses is not None:
        low, high = poses.scale_range_px_per_m
        poses = poses.model_copy(update={"scale_range_px_per_m": (low / by, high / by)})
    return params.model_copy(
        update={
            "scale": scale.model_copy(update={"px_per_m": per_m, "bar_box_px": box}),
            "poses": poses,
            "origin_px": None if params.origin_px is None else place_in(params.origin_px, by),
            "seeds_px": [place_in(seed, by) for seed in params.seeds_px],
            "wall_gap_px": params.wall_gap_px / by,
        }
    )


def size_read(by: int) -> str:
    """Return a remark, for the end of a message, on the px that it is in."""
    return f" (px of the picture at 1/{by} of its size)" if by > 1 else ""
