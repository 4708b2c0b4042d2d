"""Turn a plan's pixels into a clean mask of the workings: threshold, removal of annotation, morphology."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.errors import GeometryError
from pipeline.types import Image, Mask


def otsu_threshold(grey: np.ndarray) -> int:
    """Return the grey value that best separates the dark pixels of a uint8 array, at or below it, from the light."""
    return int(cv2.threshold(grey.reshape(-1, 1), 0, 1, cv2.THRESH_BINARY | cv2.THRESH_OTSU)[0])


def dark_pixels(grey: np.ndarray) -> Mask:
    """Return a mask of the dark pixels of a grey picture (rows, cols) uint8, by Otsu's threshold over all pixels."""
    return grey <= otsu_threshold(grey)


def binarize(
    plan: Image, threshold: int | None, annotation_chroma: int, annotation_margin_px: float, boxes: list
) -> Mask:
    """Mark dark, colourless pixels: the workings as the plan shows them, without annotation, not cleaned.

    Parameters
    ----------
    plan : (rows, cols, 3) uint8
        Channels in the order blue, green, red.
    threshold : int or None
        Pixels at or below this grey value are workings. None: Otsu's method over the pixels that are kept.
    annotation_chroma : int
        Pixels whose channels differ by more than this are coloured annotation.
    annotation_margin_px : float
        Width of the fringe around annotation that is removed too.
    boxes : list of (col0, row0, col1, row1)
        Areas to ignore, such as the scale bar.

    Returns
    -------
    (rows, cols) bool

    References
    ----------
    Otsu 1979, doi:10.1109/TSMC.1979.4310076
    """
    grey = cv2.cvtColor(plan, cv2.COLOR_BGR2GRAY)
    coloured = (plan.max(axis=2) - plan.min(axis=2) > annotation_chroma).astype(np.uint8)
    coloured = cv2.dilate(coloured, disc(annotation_margin_px))
    for col0, row0, col1, row1 in boxes:
        coloured[max(0, row0) : row1, max(0, col0) : col1] = 1
    kept = coloured == 0
    if threshold is None:
        threshold = otsu_threshold(grey[kept])
    return (grey <= threshold) & kept


def clean_mask(raw: Mask, bridge_px: float, despeck_px: float) -> Mask:
    """Close gaps and remove specks.

    Parameters
    ----------
    raw : (rows, cols) bool
    bridge_px, despeck_px : float
        Radius of the closing, and radius of the opening after it.

    Returns
    -------
    (rows, cols) bool
    """
    pad = int(np.ceil(max(bridge_px, despeck_px))) + 1  # so that the picture's edge affects neither operation
    bridged = cv2.morphologyEx(np.pad(raw.astype(np.uint8), pad), cv2.MORPH_CLOSE, disc(bridge_px))
    return _open(bridged, despeck_px)[pad:-pad, pad:-pad].astype(bool)


def fill_islands(workings: Mask, min_island_px: float) -> Mask:
    """Fill holes smaller than `min_island_px` px2, which are too small to be pillars."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats((~workings).astype(np.uint8), connectivity=8)
    rows, cols = workings.shape
    inside = (stats[:, 0] > 0) & (stats[:, 1] > 0)
    inside &= (stats[:, 0] + stats[:, 2] < cols) & (stats[:, 1] + stats[:, 3] < rows)
    small = inside & (stats[:, cv2.CC_STAT_AREA] < min_island_px)
    small[0] = False  # label 0 is the workings
    return workings | small[labels]


def left_out(raw: Mask, cleaned: Mask, min_px: float) -> list[tuple[float, float, float]]:
    """Return the drawn pieces that are not connected to the workings: area px2, column, row; largest first.

    Pieces smaller than `min_px` are specks and are not listed.
    """
    near = cv2.dilate(cleaned.astype(np.uint8), disc(2.0))
    return pieces_of(raw & (near == 0), min_px)


def pieces_of(mask: Mask, min_px: float) -> list[tuple[float, float, float]]:
    """Return the connected pieces of a mask that are not smaller: area px2, column, row; largest first."""
    _, _, stats, middle = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    pieces = [(float(s[cv2.CC_STAT_AREA]), float(x), float(y)) for s, (x, y) in zip(stats[1:], middle[1:], strict=True)]
    return sorted((p for p in pieces if p[0] >= min_px), reverse=True)


def _open(mask: np.ndarray, radius_px: float) -> np.ndarray:
    """Open a mask by a disc, then restore the right-angled corners that the opening rounded."""
    if radius_px < 1.0:  # a disc of one pixel changes nothing
        return mask
    opened = cv2.morphologyEx(mask, cv2.MORPH_OPEN, disc(radius_px))
    return mask & cv2.dilate(opened, disc((np.sqrt(2.0) - 1.0) * radius_px + 0.5))


def require_workings(
    raw: Mask, cleaned: Mask, px_per_m: float, min_tunnel_m2: float, max_workings_share: float
) -> None:
    """Refuse a plan with too small workings, or with too many dark pixels.

    Raises
    ------
    GeometryError
        The message gives the measured area or share and the limit.
    """
    share = float(raw.mean())
    if share > max_workings_share:
        raise GeometryError(
            f"{100 * share:.1f} % of the plan is dark (contours.max_workings_share = {100 * max_workings_share:g} %); "
            "is the plan inverted? survey.light_on_dark=true reads it so"
        )
    area = float(cleaned.sum()) / px_per_m**2
    if area < min_tunnel_m2:
        raise GeometryError(
            f"no dark region larger than {min_tunnel_m2:g} m2 (largest is {area:.1f} m2 at {px_per_m:.2f} px/m); "
            "is the plan inverted (survey.light_on_dark=true), or its scale wrong (--px-per-m)? A mine so small needs "
            "a lower contours.min_tunnel_m2"
        )


def disc(radius_px: float) -> np.ndarray:
    """Return a disc as a structuring element."""
    reach = int(np.floor(radius_px))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    return (x * x + y * y <= radius_px * radius_px).astype(np.uint8)
