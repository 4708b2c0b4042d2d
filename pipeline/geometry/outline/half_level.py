"""Trace workings along the half level of a plan's grey values, finer than its pixels."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float32
from shapely import Polygon
from shapely.geometry.polygon import orient
from skimage.measure import find_contours

from pipeline.errors import GeometryError
from pipeline.geometry.outline.digital_curve import straighten
from pipeline.types import Frame, Image, Mask

Cover = Float32[np.ndarray, "rows cols"]
_LEVEL = 0.5
_CLEAR = 1e-3  # covers stay this far from the level, so that no vertex falls on a pixel's centre
_BAND_PX = 2  # grey values count up to this distance from the mask's border
_FULL_STEP = 0.8  # a step of this size between two pixels has no grey value in between


def cover_of(plan: Image, raw: Mask, cleaned: Mask) -> Cover:
    """Return the share of each pixel that the workings cover, from grey values at the border of the cleaned mask.

    Grey values count within two pixels of the border, where cleaning changed nothing. Elsewhere the mask decides. Every
    pixel stays on the mask's side of one half, so the half level has the mask's topology.

    Parameters
    ----------
    plan : (rows, cols, 3) uint8
        Dark workings on light paper.
    raw, cleaned : (rows, cols) bool
        The plan's dark pixels, and the workings after cleaning.

    Returns
    -------
    (rows, cols) float32
        0 is rock, 1 is free.
    """
    cover = cleaned.astype(np.float32)
    if cleaned.any() and not cleaned.all():
        grey = cv2.cvtColor(plan, cv2.COLOR_BGR2GRAY)
        dark, light = float(np.median(grey[cleaned & raw])) if (cleaned & raw).any() else 0.0, _paper(grey, raw)
        disc = np.ones((2 * _BAND_PX + 1, 2 * _BAND_PX + 1), np.uint8)
        mask = cleaned.astype(np.uint8)
        border = cv2.dilate(mask, disc) > cv2.erode(mask, disc)
        used = border & (cv2.dilate((raw ^ cleaned).astype(np.uint8), disc) == 0)
        if light > dark:
            cover[used] = np.clip((light - grey[used].astype(np.float32)) / (light - dark), 0, 1)
    low, high = np.float32(_LEVEL - _CLEAR), np.float32(_LEVEL + _CLEAR)
    np.maximum(cover, high, out=cover, where=cleaned)
    return np.minimum(cover, low, out=cover, where=~cleaned)


def _paper(grey: np.ndarray, raw: Mask) -> float:
    """Return the grey value of the paper: the median of the pixels that are not dark."""
    return float(np.median(grey[~raw])) if not raw.all() else 255.0


def trace_half_level(cover: Cover, frame: Frame) -> Polygon:
    """Trace the largest free region along the half level of its cover, with its islands as holes.

    Marching squares place each vertex on a line between two pixel centres. Where the cover steps from 0 to 1 between
    them, the vertex is known to half a pixel only: `straighten` moves it to the smoothest curve that all pixels allow.

    Parameters
    ----------
    cover : (rows, cols) float32
        By `cover_of`, or a mask as numbers.
    frame : Frame

    Returns
    -------
    shapely.Polygon, m, mine frame
        Counter-clockwise exterior, clockwise islands.

    Raises
    ------
    GeometryError
        If nothing is free.

    References
    ----------
    Lorensen & Cline 1987, doi:10.1145/37401.37422, in two dimensions; free pixels are 4-connected.
    """
    rows, cols = np.flatnonzero((cover > _LEVEL).any(axis=1)), np.flatnonzero((cover > _LEVEL).any(axis=0))
    if not len(rows):
        raise GeometryError("outline: the mask holds no free region to trace")
    part = np.pad(cover, 2)[rows[0] : rows[-1] + 5, cols[0] : cols[-1] + 5]
    curves = [curve for curve in find_contours(part, _LEVEL) if len(curve) > 4]
    areas = np.array([_signed_area(curve) for curve in curves])
    outer = int(np.abs(areas).argmax())
    chosen = [outer, *(i for i in range(len(curves)) if areas[i] * areas[outer] < 0)]
    shift = np.array([cols[0], rows[0]]) - 2 + 0.5  # the centre of pixel k lies at k + 0.5; 2 is the padding
    rings = [curves[i][:, ::-1] for i in chosen]
    for smoothed in ([straighten(ring, _slack(part, ring)) for ring in rings], rings):
        traced = Polygon(frame.to_mine(smoothed[0] + shift), [frame.to_mine(ring + shift) for ring in smoothed[1:]])
        if traced.is_valid:
            return orient(traced)
    raise GeometryError("outline: the half level touches itself")


def _signed_area(curve: np.ndarray) -> float:
    x, y = curve[:-1].T - curve[0][:, None]
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _slack(cover: np.ndarray, ring: np.ndarray) -> np.ndarray:
    """Return how far, px, the wall may lie from each vertex (n, 2; column, row): half a pixel at a full step."""
    low, high = np.floor(ring).astype(int), np.ceil(ring).astype(int)
    step = np.abs(cover[low[:, 1], low[:, 0]] - cover[high[:, 1], high[:, 0]])
    return np.where(step >= _FULL_STEP, 0.5, 0.12)
