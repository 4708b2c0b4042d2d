"""Find workings that a drawing sheet shows as filled or hatched areas."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.geometry.binarize import fill_islands
from pipeline.types import Image, Mask

_INK = 24  # difference of a channel from the paper; compression changes paper by less
_STROKE_PX = 3.0  # half the thickness of what is an area and no line
_HATCH_PX = 5.0  # hatch lines nearer than twice this form an area
_NARROW = 0.15  # of the drifts' width: thinner parts are lines and letters that touch the area
_LETTER = 0.3  # of the drifts' width: the side of the largest hole that is a light letter
_OUTLINED = 0.4  # share of the border that an outline covers, by its darkness
_DARKER = 30
_DARK_OUTLINE = 110


def paper_colour(picture: Image) -> np.ndarray:
    """Return the most frequent colour (3,) of a picture, in steps of 8."""
    coarse = (picture >> 3).reshape(-1, 3).astype(np.int32)
    code = (coarse[:, 0] << 10) | (coarse[:, 1] << 5) | coarse[:, 2]
    most = int(np.bincount(code).argmax())
    return np.median(picture.reshape(-1, 3)[code == most], axis=0)


def find_ink(picture: Image) -> Mask:
    """Mark all that differs from the paper."""
    return np.asarray(np.abs(picture.astype(np.int16) - paper_colour(picture).astype(np.int16)).max(axis=2) > _INK)


def find_areas(ink: Mask, hatched: bool) -> Mask:
    """Return the areas among ink: what is thicker than any line; with `hatched`, hatch lines are closed first."""
    mask = ink.astype(np.uint8)
    if hatched:
        mask = cv2.morphologyEx(np.pad(mask, 8), cv2.MORPH_CLOSE, disc(_HATCH_PX))[8:-8, 8:-8]
    return cv2.morphologyEx(mask, cv2.MORPH_OPEN, disc(_STROKE_PX)).astype(bool)


def fill_workings(picture: Image, ink: Mask, area: Mask, hatched: bool) -> tuple[Mask, float]:
    """Return the workings round an area: without lines and letters that touch it, without light letters in it.

    Where an outline is drawn, the wall is the middle of the outline; the second result is the share of the border that
    has one.
    """
    width = 2 * ridge_half_width(area)
    near = cv2.dilate(area.astype(np.uint8), disc(2 * _STROKE_PX + 1))
    mask = (ink | area) & (near > 0)
    if hatched:
        mask |= area
    radius = max(_STROKE_PX, _NARROW * width)
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, disc(radius))
    mask = mask & (cv2.dilate(opened, disc(0.42 * radius + 0.5)) > 0)
    mask = fill_islands(mask, (_LETTER * width) ** 2)
    half = _half_outline(picture, mask, hatched)
    if half < 0.5:
        return mask, 0.0
    distance = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)
    dark = cv2.erode(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), disc(half + 1)) < _DARK_OUTLINE
    border = (distance > half) & (distance <= half + 1)
    return distance > half, float(dark[border].mean()) if border.any() else 0.0


def _half_outline(picture: Image, mask: Mask, hatched: bool) -> float:
    """Return how far the middle of a drawn outline lies inside a filled area, px; 0 if there is no outline."""
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY).astype(np.int16)
    distance = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)
    core = grey[distance > 6]
    if not len(core):
        return 0.0
    fill = int(np.percentile(core, 75 if hatched else 50))
    darkest = int(np.percentile(grey[(distance > 0) & (distance < 8)], 2))
    if darkest > fill - _DARKER:
        return 0.0
    share = np.clip((fill - grey) / (fill - darkest), 0.0, 1.0)  # of the stroke's darkness
    profile = np.array([share[(distance > d - 0.5) & (distance <= d + 0.5)].mean() for d in range(1, 9)])
    inner = profile[-3:].mean()
    profile = np.clip((profile - inner) / max(0.2, 1 - inner), 0.0, None)
    if profile[:3].max() < _OUTLINED:
        return 0.0
    return float((np.arange(1, 9) * profile).sum() / profile.sum())


def ridge_half_width(mask: Mask) -> float:
    """Return the median distance from the middle of a mask's parts to their edge, px."""
    distance = cv2.distanceTransform(np.pad(mask.astype(np.uint8), 1), cv2.DIST_L2, 5)
    ridge = (distance >= cv2.dilate(distance, np.ones((3, 3)))) & (distance > 2)
    return float(np.median(distance[ridge])) if ridge.any() else 0.0


def disc(radius_px: float) -> np.ndarray:
    """Return a disc as a structuring element."""
    reach = int(np.floor(radius_px))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    return (x * x + y * y <= radius_px * radius_px).astype(np.uint8)
