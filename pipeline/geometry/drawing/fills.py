"""Find workings that a drawing shows as filled areas."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.geometry.outline.binarize import disc, fill_islands
from pipeline.types import Image, Mask

_INK = 24  # difference of a channel from the paper; compression changes paper by less
_STRIP_ROWS = 256
_STROKE_PX = 3.0  # half the thickness of what is an area and no line
_NARROW = 0.15  # of the drifts' width: thinner parts are lines and letters that touch the area
_LETTER = 0.3  # of the drifts' width: the side of the largest hole that is a light letter
_SHADE, _UNIFORM, _BESIDE = 20, 0.6, 0.9  # grey values of one fill; share that has them, or lies beside such
_OUTLINES, _OUTLINES_PX = 0.4, (7, 13)  # both outlines of a drift, of its width, and px
_MIDWAY = 0.4  # of the difference between a light fill and the paper: what belongs to one of them differs by less
_LINE_PX = 1.0  # half the thickness of strokes in the rock that have the colour of a fill
_WIDE_PX, _CORNER_PX = 4.0, 40  # half the width of paper between workings, and depth of narrower one, as in a corner
_WORD_PX = 30  # narrow paper beside a grid line is longer than the strokes of light letters
_RIM_PX = 3.0  # round a cell of paper
_LETTER_PX = 2.5  # half the stroke of a light letter, also of two words that overlap
_IN_FILLING = 0.3  # of its rim that is filling round a light letter; outlines and strokes bound paper in the rock


def paper_colour(picture: Image) -> np.ndarray:
    """Return the most frequent colour (3,) of a picture, in steps of 8."""
    counts = np.sum([np.bincount(_coarse(strip), minlength=1 << 15) for strip in _strips(picture)], axis=0)
    most = int(counts.argmax())
    values = np.zeros((3, 256), np.int64)
    for strip in _strips(picture):
        alike = strip.reshape(-1, 3)[_coarse(strip) == most]
        values += [np.bincount(alike[:, channel], minlength=256) for channel in range(3)]
    return np.array([_median_of(counts) for counts in values])


def _median_of(counts: np.ndarray) -> float:
    """Return the median of values of which value k occurs counts[k] times."""
    below, count = np.cumsum(counts), int(counts.sum())
    low, high = np.searchsorted(below, [(count - 1) // 2 + 1, count // 2 + 1])
    return (int(low) + int(high)) / 2


def _coarse(picture: Image) -> np.ndarray:
    """Return a number of 15 bits for the colour of each pixel, in steps of 8."""
    coarse = (picture >> 3).reshape(-1, 3).astype(np.int32)
    return np.asarray((coarse[:, 0] << 10) | (coarse[:, 1] << 5) | coarse[:, 2])


def _strips(picture: Image) -> list[Image]:
    """Return a picture in strips, so that numbers wider than its own need little memory."""
    return [picture[row : row + _STRIP_ROWS] for row in range(0, len(picture), _STRIP_ROWS)]


def find_ink(picture: Image) -> Mask:
    """Mark all that differs from the paper."""
    return ~_within(picture, paper_colour(picture).astype(np.int16), _INK)


def _within(picture: Image, colour: np.ndarray, most: float) -> Mask:
    """Mark the pixels none of whose channels differs from a colour (3,) by more than `most`."""
    near = (np.abs(np.arange(256)[:, None] - colour) <= most).astype(np.uint8)  # of each value of each channel
    one, two, three = (cv2.LUT(channel, near[:, k]) for k, channel in enumerate(cv2.split(picture)))
    return np.asarray((one & two & three).view(bool))


def find_areas(ink: Mask) -> Mask:
    """Return the areas among ink: what is thicker than any line."""
    return cv2.morphologyEx(ink.astype(np.uint8), cv2.MORPH_OPEN, disc(_STROKE_PX)) > 0


def fill_shade(picture: Image, area: Mask) -> np.ndarray | None:
    """Return the one colour (3,) of a filled area, apart from letters and lines in it; None if it has several."""
    side = round(float(np.clip(_OUTLINES * 2 * ridge_half_width(area), *_OUTLINES_PX)))
    inside = cv2.erode(area.astype(np.uint8), np.ones((side, side), np.uint8)) > 0
    if not inside.any():
        return None
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    most = int(np.bincount(grey[inside]).argmax())
    filling = np.abs(grey.astype(np.int16) - most) <= _SHADE
    beside = cv2.dilate(filling.astype(np.uint8), disc(_STROKE_PX)) > 0
    if filling[inside].mean() < _UNIFORM or beside[inside].mean() < _BESIDE:
        return None
    return np.median(picture[inside & filling], axis=0)


def find_shade(picture: Image, shade: np.ndarray) -> Mask:
    """Return the filling: what has a colour (3,) and is wider than strokes in the rock."""
    filling = _near_colour(picture, shade, paper_colour(picture)).astype(np.uint8)
    return cv2.morphologyEx(filling, cv2.MORPH_OPEN, disc(_LINE_PX)) > 0


def _near_colour(picture: Image, colour: np.ndarray, other: np.ndarray) -> Mask:
    """Mark what has a colour (3,), by less than its difference from another one."""
    within = min(float(_SHADE), _MIDWAY * float(np.abs(colour - other).max()))
    return _within(cv2.medianBlur(picture, 3), colour, within)


def find_filled(picture: Image, shade: np.ndarray, cells: bool | None = None) -> Mask:
    """Return the areas of a colour (3,): each pixel of anything else goes to the nearest filling or wide paper.

    So a wall is the middle of its outline, and letters and lines in a filling, or in the paper, do not count. A small
    cell of paper, such as one between a wall, a grid line and strokes in the rock, is outside as wide paper is. A light
    letter is thin, or filling bounds much of it. With `cells` all small cells are letters; if it is
    False, only thin ones.
    """
    filling = find_shade(picture, shade).astype(np.uint8)
    blank = _near_colour(picture, paper_colour(picture), shade).astype(np.uint8)
    distance = cv2.distanceTransform(np.pad(blank, 8, constant_values=1), cv2.DIST_L2, 5)[8:-8, 8:-8]
    outside = (distance > _WIDE_PX).astype(np.uint8)
    for _ in range(_CORNER_PX):
        reached = cv2.dilate(outside, disc(1.0)) & blank
        if cv2.norm(reached, outside, cv2.NORM_INF) == 0:
            break
        outside = reached
    _, labels, stats, _ = cv2.connectedComponentsWithStats(blank, connectivity=4)
    large = np.maximum(stats[:, 2], stats[:, 3]) > _WORD_PX
    thick = np.isin(np.arange(len(stats)), labels[distance > _LETTER_PX])
    if not cells:
        large |= thick if cells is False else thick & (_filled_rim(labels, filling, len(stats)) < _IN_FILLING)
    outside |= (large[labels] & ~_meets(labels, outside, len(stats))).astype(np.uint8) & blank
    seeds = filling | outside
    _, nearest = cv2.distanceTransformWithLabels(1 - seeds, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    is_filled = np.zeros(int(nearest.max()) + 1, bool)
    is_filled[nearest[seeds > 0]] = filling[seeds > 0] > 0
    return np.asarray(is_filled[nearest])


def _filled_rim(labels: np.ndarray, filling: np.ndarray, count: int) -> np.ndarray:
    """Return the share (count,) of the pixels round each cell of paper that are filling."""
    beside = np.flatnonzero(labels == 0)
    to_cell, nearest = cv2.distanceTransformWithLabels(
        (labels == 0).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    cell_of = np.zeros(int(nearest.max()) + 1, np.int32)
    cell_of[nearest[labels > 0]] = labels[labels > 0]
    beside = beside[to_cell.flat[beside] <= _RIM_PX]
    cells = cell_of[nearest.flat[beside]]
    rim = np.maximum(np.bincount(cells, minlength=count), 1)
    return np.asarray(np.bincount(cells, filling.flat[beside], minlength=count) / rim)


def _meets(labels: np.ndarray, mask: np.ndarray, count: int) -> Mask:
    """Mark all pixels of those labels that a mask meets."""
    met = np.zeros(count, bool)
    met[labels[mask > 0]] = True
    return np.asarray(met[labels])


def trim(mask: Mask, width_px: float) -> Mask:
    """Return an area without lines and letters that touch it, and without light letters in it."""
    radius = max(_STROKE_PX, _NARROW * width_px)
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, disc(radius))
    mask = mask & (cv2.dilate(opened, disc(0.42 * radius + 0.5)) > 0)
    return fill_islands(mask, (_LETTER * width_px) ** 2)


def ridge_half_width(mask: Mask) -> float:
    """Return the median distance from the middle of a mask's parts to their edge, px."""
    distance = cv2.distanceTransform(np.pad(mask.astype(np.uint8), 1), cv2.DIST_L2, 5)
    ridge = (distance >= cv2.dilate(distance, np.ones((3, 3)))) & (distance > 2)
    return float(np.median(distance[ridge])) if ridge.any() else 0.0
