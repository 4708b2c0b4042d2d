"""Even out the light of a photographed plan: a gradient, a shadow, the darker corners of a lens."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.geometry.outline.binarize import disc, otsu_threshold
from pipeline.types import Image, Mask

BETTER_LIGHT = "; its light is uneven, as in a photograph: scan the plan, or photograph it flat in even light"
_EVEN = 0.45  # of the pixels within one grey value of the most frequent one: drawings have 0.5 or more, photographs 0.2
_UNEVEN = 0.2  # of the light that the darkest paper lacks; thresholds over the whole picture bear less
_SIDE_PX, _FIT_PX = 512, 64  # longest side of the copies on which the light is measured, and a smooth one is fitted
_SOFT_PX = 1.5  # of the copy: noise is smoothed
_INK = 0.1  # half the width of what the closing takes for ink, of the shorter side
_PART = 0.05  # of the picture, that paper covers at least
_PAPER, _FILL = 0.8, 0.35  # of the fitted light: darker pixels are not fitted; darker areas are wide fills
_WHITE = 1.1  # paper is made a little lighter than white: noise and the rest of a shadow's edge differ by less
_PALE = 90  # difference of channels below which a colour is the rest of the light's; print has 150 or more
_NOISE, _MOST_BLUR_PX = 7.0, 2.5  # grey values of noise for each pixel of smoothing, and the most smoothing
_ROWS, _STRIPS = 64, 16  # of the picture, in which the noise is measured
_NEAR_PX = 4.0  # noise is what differs from its surroundings


def even_light(picture: Image) -> tuple[Image, float]:
    """Return a picture, dark on light, with its paper white everywhere, and how dark the darkest paper was.

    Drawings and flat scans are returned as they are: many of their pixels have one grey value, or their paper varies
    by less than a fifth. Noise of a photograph is smoothed as far as it is strong.

    Parameters
    ----------
    picture : (rows, cols, 3) uint8

    Returns
    -------
    picture : (rows, cols, 3) uint8
    darkest : float
        Light of the darkest paper, as a share of the lightest; 1 if the picture is returned as it is.

    References
    ----------
    Gatos, Pratikakis and Perantonis 2006, "Adaptive degraded document image binarization": ink relative to the paper
    that is estimated behind it. The estimate here is a morphological closing, and a cubic surface behind wide fills.
    """
    if has_one_grey(picture):
        return picture, 1.0
    light = _paper_light(picture)
    low, high = np.percentile(light.max(axis=2), (2, 98))
    if low > (1 - _UNEVEN) * high:
        return picture, 1.0
    rows, cols = picture.shape[:2]
    full = cv2.resize(np.round(light).astype(np.uint8), (cols, rows), interpolation=cv2.INTER_LINEAR)
    blur_px = min(_noise(picture, full) / _NOISE, _MOST_BLUR_PX)
    if blur_px > 0:
        picture = cv2.GaussianBlur(picture, (0, 0), max(blur_px, 0.1))
    evened = cv2.divide(picture, full, scale=255 * _WHITE)
    blue, green, red = cv2.split(evened)
    pale = cv2.subtract(cv2.max(cv2.max(blue, green), red), cv2.min(cv2.min(blue, green), red)) < _PALE
    cv2.copyTo(cv2.cvtColor(cv2.cvtColor(evened, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR), pale.view(np.uint8), evened)
    return evened, float(low / high)


def has_one_grey(picture: Image) -> bool:
    """Return whether much of a picture has one grey value, as the paper of drawings and of flat scans."""
    counts = cv2.calcHist([cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)], [0], None, [256], [0, 256]).ravel()
    return bool(np.convolve(counts, np.ones(3), "same").max() >= _EVEN * counts.sum())


def is_light_on_dark(picture: Image) -> bool:
    """Return whether a plan is drawn light on dark, by the grey values at the edge of its picture.

    Dim paper may be dark there, too: what counts is whether the edge is among the darker pixels, in a photograph
    without the trend of the light.
    """
    if np.median(_edge(picture).mean(axis=1)) >= 128:
        return False
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    if not has_one_grey(picture):
        log = np.log(np.maximum(_shrunk(grey, _FIT_PX), 4).astype(np.float32))
        level = log - _fitted(log, np.ones(log.shape, bool), 2)
        grey = np.round((level - level.min()) / max(float(np.ptp(level)), 1e-6) * 255).astype(np.uint8)
    return bool(np.median(_edge(grey)) <= otsu_threshold(grey))


def _edge(picture: np.ndarray) -> np.ndarray:
    return np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]])


def _paper_light(picture: Image) -> np.ndarray:
    """Return the colour that the paper has, or would have behind the ink, in a small copy (rows, cols, 3) float32."""
    small = cv2.GaussianBlur(_shrunk(picture, _SIDE_PX), (0, 0), _SOFT_PX)
    reach = max(3, round(_INK * min(small.shape[:2])))
    wide = cv2.copyMakeBorder(small, *[reach] * 4, cv2.BORDER_REPLICATE)  # a shadow goes on beyond the picture
    closed = cv2.morphologyEx(wide, cv2.MORPH_CLOSE, disc(reach))[reach:-reach, reach:-reach].astype(np.float32)
    light = [_without_fills(channel) for channel in cv2.split(closed)]
    return np.maximum(cv2.GaussianBlur(cv2.merge(light), (0, 0), 2 * _SOFT_PX), 1.0)


def _without_fills(light: np.ndarray) -> np.ndarray:
    """Replace what is far darker than a smooth surface through the paper, and its soft border, by that surface."""
    small = _shrunk(light, _FIT_PX)
    paper = np.ones(small.shape, bool)
    for _ in range(12):
        surface = _fitted(small, paper, 3)
        is_lighter = small > _PAPER * surface
        if (is_lighter == paper).all() or is_lighter.mean() < _PART:
            break
        paper = is_lighter
    fitted = cv2.resize(surface, light.shape[::-1], interpolation=cv2.INTER_LINEAR)
    fills = cv2.dilate((light < _FILL * fitted).astype(np.uint8), disc(5.0)) > 0
    return np.where(fills, fitted, light)


def _fitted(values: np.ndarray, kept: Mask, degree: int) -> np.ndarray:
    """Return the polynomial surface of a degree through the kept values, by least squares."""
    y, x = np.mgrid[-1 : 1 : values.shape[0] * 1j, -1 : 1 : values.shape[1] * 1j]
    terms = np.stack([x**i * y**j for i in range(degree + 1) for j in range(degree + 1 - i)], axis=-1)
    factors = np.linalg.lstsq(terms[kept], values[kept].astype(float), rcond=None)[0]
    return np.asarray(terms @ factors, np.float32)


def _noise(picture: Image, light: Image) -> float:
    """Return the standard deviation of the paper's noise once its light is evened, in grey values, from some rows."""
    apart = []
    for row in range(0, len(picture), max(_ROWS, len(picture) // _STRIPS)):
        rows = slice(row, row + _ROWS)
        evened = cv2.divide(picture[rows], light[rows], scale=255)
        paper = evened.min(axis=2) > 0.6 * 255
        apart.append(cv2.absdiff(evened, cv2.GaussianBlur(evened, (0, 0), _NEAR_PX))[paper])
    values = np.concatenate(apart)
    return float(np.median(values)) / 0.6745 if len(values) else 0.0


def _shrunk(picture: np.ndarray, side_px: int) -> np.ndarray:
    """Return a copy whose longest side is at most `side_px`, of means of pixels."""
    by = max(picture.shape[:2]) / side_px
    size = tuple(max(4, round(side / by)) for side in picture.shape[1::-1])
    return picture if by <= 1 else cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
