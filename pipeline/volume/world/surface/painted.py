"""The picture of a scanned rock: the colours of the scan, with the grain of the texture in them."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

from pipeline.types import Image
from pipeline.volume.world.surface.charts import Charts
from pipeline.volume.world.surface.scanned import ScanColours

_AT_ONCE = 300_000  # pixels
_BESIDE_PX = 1.5  # from a face: a renderer mixes such pixels in
_THIN_PX = 1e-6
_GRAIN_M = 0.1  # longer structures are those of the scan's colours, shorter ones those of the texture


def paint(
    vertices: np.ndarray,
    faces: np.ndarray,
    corners_m: np.ndarray,
    charts: Charts,
    side_px: int,
    colours: ScanColours,
    texture: Image,
    repeat_m: float,
) -> Image:
    """Return the picture (side, side, 3) of the charts, BGR.

    Where the scan has points, it has their colours and the texture's structures up to 10 cm; elsewhere it is the
    texture, with the mean colour of the scan.

    Parameters
    ----------
    vertices : (n, 3) float64, m
    faces : (m, 3) int
    corners_m : (m, 3, 2) float64, m
        Coordinates of the corners on the texture, before charts move them.
    charts : Charts
    side_px : int
        Of the picture.
    colours : ScanColours
    texture : (size, size, 3) uint8
        Covers `repeat_m` once, and repeats.
    repeat_m : float
    """
    pixel_m = charts.across_m / side_px
    nearest = np.full(side_px**2, -np.inf, np.float32)
    place, laid = np.zeros((side_px**2, 3), np.float32), np.zeros((side_px**2, 2), np.float32)
    moved_px = (corners_m + charts.shift_m[charts.number][:, None]) / pixel_m
    for face, pixel, share, inside in _pixels(moved_px, side_px):
        better = inside > nearest[pixel]
        face, pixel, share, inside = face[better], pixel[better], share[better], inside[better]
        order = np.argsort(inside, kind="stable")  # of equal pixels the last one is kept
        face, pixel, share = face[order], pixel[order], share[order]
        nearest[pixel] = inside[order]
        place[pixel] = np.einsum("nk,nkd->nd", share, vertices[faces[face]])
        laid[pixel] = np.einsum("nk,nkd->nd", share, corners_m[face])
    grain = _Grain(texture, repeat_m, pixel_m)
    picture, covered = np.zeros((side_px**2, 3), np.float32), np.flatnonzero(nearest > -np.inf)
    for first in range(0, len(covered), _AT_ONCE):
        some = covered[first : first + _AT_ONCE]
        found, synthetic = colours.at(place[some].astype(float))
        picture[some] = found[:, ::-1] * grain.at(laid[some], synthetic)
    picture = _filled(picture.reshape(side_px, side_px, 3), (nearest > -np.inf).reshape(side_px, side_px))
    return np.asarray(np.clip(np.rint(picture[::-1]), 0, 255), np.uint8)  # rows of a picture run down


class _Grain:
    """By what a texture multiplies colours."""

    def __init__(self, texture: Image, repeat_m: float, pixel_m: float) -> None:
        self._count, self._pixel_m = max(1, round(repeat_m / pixel_m)), pixel_m
        small = cv2.resize(texture, (self._count,) * 2, interpolation=cv2.INTER_AREA).astype(np.float32)
        self._texture = np.maximum(small, 1.0)
        self._mean = self._texture.mean(axis=(0, 1))
        self._smooth = gaussian_filter(self._texture, (*(_GRAIN_M / pixel_m,) * 2, 0), mode="wrap")

    def at(self, laid_m: np.ndarray, synthetic: np.ndarray) -> np.ndarray:
        """Return the factors (n, 3) at coordinates (n, 2) m: of all structures where `synthetic` (n,) is 1."""
        x, y = np.floor(laid_m / self._pixel_m).astype(np.int64).T
        at = (-1 - y) % self._count, x % self._count
        share = synthetic[:, None]
        return np.asarray(self._texture[at] / (self._smooth[at] * (1 - share) + self._mean * share))


_Pixels = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def _pixels(corners: np.ndarray, side: int) -> Iterator[_Pixels]:
    """Yield the pixels in and beside triangles (m, 3, 2) px, in blocks.

    Yields
    ------
    face, pixel : (n,) int
        A pixel's number is its column plus `side` times its row, from below.
    share : (n, 3)
        Of the triangle's corners at the pixel's middle, or at the place in the triangle that is next to it.
    inside : (n,)
        How far the middle is from the nearest side, px, negative outside.
    """
    ends = np.roll(corners, -1, axis=1) - corners
    double = ends[:, 0, 0] * ends[:, 1, 1] - ends[:, 0, 1] * ends[:, 1, 0]
    low = np.maximum(np.floor(corners.min(axis=1) - _BESIDE_PX).astype(np.int64), 0)
    size = np.minimum(np.ceil(corners.max(axis=1) + _BESIDE_PX).astype(np.int64), side) - low
    count = size.prod(axis=1) * (np.abs(double) > _THIN_PX)
    block = np.cumsum(count) // _AT_ONCE
    for some in np.split(np.arange(len(count)), np.flatnonzero(np.diff(block)) + 1):
        face = np.repeat(some, count[some])
        own = np.arange(len(face)) - np.repeat(np.cumsum(count[some]) - count[some], count[some])
        column, row = low[face, 0] + own % size[face, 0], low[face, 1] + own // size[face, 0]
        middle = np.column_stack([column, row]) + 0.5
        a, b, c = (middle - corners[face, k] for k in range(3))
        opposite = [one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0] for one, other in ((b, c), (c, a), (a, b))]
        share = np.column_stack(opposite) / double[face, None]
        long = np.linalg.norm(ends[face][:, [1, 2, 0]], axis=2)
        inside = (share * np.abs(double[face, None]) / np.maximum(long, _THIN_PX)).min(axis=1)
        kept = inside >= -_BESIDE_PX
        share = np.clip(share[kept], 0.0, 1.0)
        yield face[kept], (column + side * row)[kept], share / share.sum(axis=1, keepdims=True), inside[kept]


def _filled(picture: np.ndarray, covered: np.ndarray) -> np.ndarray:
    """Return a picture whose other pixels have the colours of covered ones about them, from a picture half as large.

    References
    ----------
    Gortler et al. 1996, "The Lumigraph", SIGGRAPH (pull and push)
    """
    if covered.all() or not covered.any():
        return picture
    rows, cols = covered.shape
    even = ((0, rows % 2), (0, cols % 2))
    weight = np.pad(covered, even).astype(np.float32)
    colour = np.pad(picture * covered[..., None], (*even, (0, 0)))
    sums, counts = _by_four(colour), _by_four(weight[..., None])
    half = _filled(sums / np.maximum(counts, 1), counts[..., 0] > 0)
    large = np.repeat(np.repeat(half, 2, axis=0), 2, axis=1)[:rows, :cols]
    return np.asarray(np.where(covered[..., None], picture, large))


def _by_four(values: np.ndarray) -> np.ndarray:
    rows, cols, channels = values.shape
    return np.asarray(values.reshape(rows // 2, 2, cols // 2, 2, channels).sum(axis=(1, 3)))
