"""Find the workings on a drawing of any size: a large one is searched at a bounded resolution."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np

from pipeline.geometry.drawing.doubts import DrawingError
from pipeline.geometry.drawing.find import DrawingReading, read_drawing
from pipeline.geometry.outline.binarize import dark_pixels
from pipeline.types import Image, Mask

MOST_PX = 2e6  # the search takes up to 10 s a megapixel
_THICK = 0.5  # share of the ink that stays visible in the copy


def read_bounded(picture: Image, level: int | None, reduction: int = 1) -> DrawingReading:
    """Find the workings on a drawing; as `read_drawing` up to `MOST_PX`, else on a smaller copy of the picture.

    The mask is as large as the picture. Its border is interpolated: it is right to half a pixel of the copy.
    `reduction` is how much smaller the picture is than the user's; messages state shares of the latter.

    Raises
    ------
    GeometryError
        As for `read_drawing`; a message that has places in the copy says how large that is.
    """
    share = share_of(picture)
    if share == 1.0:
        return read_drawing(picture, level)
    try:
        return _enlarged(read_drawing(_copy_of(picture, share), level), picture)
    except DrawingError as error:
        message = f"{error} (the picture was searched at {100 * share / reduction:.0f} % of its size)"
        raise type(error)(message, _mask_as(error.found, picture)) from error


def _copy_of(picture: Image, share: float) -> Image:
    """Return a smaller copy. Lines that would fade in it are thickened first; a filled area keeps its border."""
    side = math.ceil(1 / share)
    square = np.ones((side, side), np.uint8)
    ink = dark_pixels(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)).astype(np.uint8)
    thick = cv2.morphologyEx(ink, cv2.MORPH_OPEN, square)
    if np.count_nonzero(thick) < _THICK * np.count_nonzero(ink):
        picture = cv2.erode(picture, square)
    size = (round(picture.shape[1] * share), round(picture.shape[0] * share))
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def share_of(picture: Image) -> float:
    """Return how large the copy that is searched is, as a share of the picture's side."""
    return min(1.0, math.sqrt(MOST_PX / (picture.shape[0] * picture.shape[1])))


def _enlarged(found: DrawingReading, picture: Image) -> DrawingReading:
    by = np.array(picture.shape[:2][::-1]) / found.mask.shape[::-1]
    boxes = [tuple(np.round(np.array(box) * [*by, *by]).astype(int).tolist()) for box in found.boxes]
    return replace(found, mask=_mask_as(found.mask, picture), boxes=boxes, width_px=found.width_px * float(by.mean()))


def _mask_as(mask: Mask, picture: Image) -> Mask:
    """Return a mask as large as a picture."""
    size = (picture.shape[1], picture.shape[0])
    return np.asarray(cv2.resize(mask.astype(np.uint8) * 255, size, interpolation=cv2.INTER_LINEAR) >= 128)
