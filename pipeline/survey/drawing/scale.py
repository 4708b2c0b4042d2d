"""Find a plan's scale bar and measure the scale, px/m."""

from __future__ import annotations

from contextlib import suppress

import cv2
import numpy as np

from minesurveys.errors import InputError
from pipeline.geometry.outline.binarize import dark_pixels
from pipeline.survey.drawing.bar_pieces import (
    FILLED,
    is_piece_beside,
    tick_distance_px,
    with_pieces_joined,
    without_holes,
)
from pipeline.types import Image

_MIN_BAR_PX = 20
_ADVICE = "; --bar-box COL0,ROW0,COL1,ROW1 states where the bar is, --px-per-m the scale without a bar"
_SPECK_PX = 5  # JPEG compression produces smaller specks
_MIN_ASPECT = 5.0  # smallest ratio of a bar's length to its thickness


def find_bar(picture: Image) -> tuple[int, int, int, int] | None:
    """Find a scale bar: the longest dark, straight, horizontal region that stands alone, or one in pieces.

    The plan's largest region is never the bar. Digits may stand at its ends.

    Returns
    -------
    (col0, row0, col1, row1), px, or None
        The bar's box with some paper around it.
    """
    dark = without_holes(dark_pixels(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)).astype(np.uint8))
    whole, joined = _longest_bar(picture, dark), with_pieces_joined(dark)
    if whole is None:
        return _longest_bar(picture, joined)
    left, top, right, bottom = whole
    row, middle = (top + bottom) // 2, (left + right) // 2
    if (joined[row] > dark[row]).any():
        piece = cv2.connectedComponents(joined)[1]
        only = (piece == piece[row, middle]).astype(np.uint8)  # the bar of which the longest piece was found
        return _longest_bar(picture, only, alone=True) or whole
    return whole


def _longest_bar(picture: Image, dark: np.ndarray, alone: bool = False) -> tuple[int, int, int, int] | None:
    """Return the box of the longest bar among dark regions, the largest of which is none unless it is `alone`."""
    count, _, stats, _ = cv2.connectedComponentsWithStats(dark)
    if count < 3 - alone:
        return None
    width, height, area = stats[:, 2].astype(float), stats[:, 3].astype(float), stats[:, 4]
    fits = (width >= _MIN_BAR_PX) & (width >= _MIN_ASPECT * height) & (area >= FILLED * width * height)
    fits[0] = False
    if not alone:
        fits[1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())] = False
    candidates = np.flatnonzero(fits)
    for i in candidates[np.argsort(-width[candidates], kind="stable")]:  # the longest bar that can be measured
        left, top, right, bottom = (int(v) for v in (*stats[i, :2], *(stats[i, :2] + stats[i, 2:4])))
        gap = max(3, (bottom - top) // 2)
        box = max(0, left - gap), max(0, top - gap), min(dark.shape[1], right + gap), min(dark.shape[0], bottom + gap)
        with suppress(InputError):
            measure_bar(picture[box[1] : box[3], box[0] : box[2]], 1.0, "bar")
            return box
    return None


def measure_bar(picture: Image, bar_length_m: float, name: str) -> float:
    """Measure a horizontal scale bar.

    Parameters
    ----------
    picture : (rows, cols, 3) uint8
        The bar, dark on light, with light pixels around it. It may be in dark and light pieces, or a line between two
        ticks, whose middles are its ends; digits may stand at its ends.
    bar_length_m : float
        The length that the bar represents.
    name : str
        The picture's name in errors.

    Returns
    -------
    float
        px/m. The error is up to one pixel in the bar's length.

    Raises
    ------
    InputError
        If there is no bar, or it is vertical, broken or too short. The message states its size in px.
    """
    if picture.size == 0:
        raise InputError(f"{name}: the scale bar's box is empty")
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    dark = with_pieces_joined(without_holes(dark_pixels(grey).astype(np.uint8)))
    if int(grey.max()) - int(grey.min()) < 64 or not dark.any():
        raise InputError(
            f"{name}: no scale bar (grey values {grey.min()}-{grey.max()}, expected a dark bar on light paper){_ADVICE}"
        )
    count, labels, stats, _ = cv2.connectedComponentsWithStats(dark)
    sizes = stats[1:, cv2.CC_STAT_AREA]
    bar = int(sizes.argmax()) + 1
    left, top, width, height, area = (int(v) for v in stats[bar])
    if height >= width:
        raise InputError(
            f"{name}: the scale bar is {width} px wide and {height} px high; it must lie horizontally{_ADVICE}"
        )
    if left == 0 or top == 0 or left + width == dark.shape[1] or top + height == dark.shape[0]:
        raise InputError(
            f"{name}: the scale bar ({width} x {height} px) touches the edge; leave some light paper around it{_ADVICE}"
        )
    other_pieces = [
        i for i in range(1, count) if i != bar and stats[i, 4] >= _SPECK_PX and is_piece_beside(stats[i], stats[bar])
    ]
    if other_pieces:
        raise InputError(
            f"{name}: the scale bar is broken into {len(other_pieces) + 1} pieces (longest {width} px){_ADVICE}"
        )
    if area < FILLED * width * height and width >= _MIN_BAR_PX:
        apart = tick_distance_px(labels[top : top + height, left : left + width] == bar)
        if apart:
            return apart / bar_length_m
    if area < FILLED * width * height:
        raise InputError(
            f"{name}: the dark region of {width} x {height} px is not a straight bar (it fills "
            f"{100 * area / width / height:.0f} % of its box, at least {100 * FILLED:.0f} % are needed){_ADVICE}"
        )
    if width < _MIN_BAR_PX:
        raise InputError(f"{name}: the scale bar is {width} px long, at least {_MIN_BAR_PX} are needed{_ADVICE}")
    runs = (labels == bar).sum(axis=1)
    return float(np.median(runs[runs > width / 2])) / bar_length_m
