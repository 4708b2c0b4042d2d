"""Fill the workings of a plan whose walls are drawn as lines."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.errors import GeometryError
from pipeline.types import Mask

_FRAME = 0.9  # of the picture's sides; a larger region lies within a frame round the plan


def fill_line_drawing(lines: Mask, seeds_px: list[tuple[float, float]], gap_px: float) -> Mask:
    """Fill the regions that drawn walls enclose, up to the middle of the lines.

    Gaps up to `gap_px` are closed first. With seeds, the regions that contain a seed are filled. Without seeds, the
    regions that an odd number of walls separates from the picture's edge are filled; a frame round the whole plan does
    not count as a wall.

    Parameters
    ----------
    lines : (rows, cols) bool
        True where a wall is drawn.
    seeds_px : list of (col, row)
        Places inside the workings.
    gap_px : float

    Returns
    -------
    (rows, cols) bool

    Raises
    ------
    GeometryError
        If nothing is enclosed, or a seed lies on a wall, outside the picture, or in a region that reaches its edge.
    """
    closed = cv2.morphologyEx(
        np.pad(lines.astype(np.uint8), 1),
        cv2.MORPH_CLOSE,
        cv2.getStructuringElement(cv2.MORPH_ELLIPSE, _odd_size(gap_px)),
    )[1:-1, 1:-1]
    if closed.all():
        raise GeometryError("the drawn walls cover the whole picture; survey.wall_gap_px closes gaps up to its width")
    _, regions, stats, _ = cv2.connectedComponentsWithStats(1 - closed, connectivity=4)
    rows, cols = lines.shape
    touches = (stats[:, 0] == 0) | (stats[:, 1] == 0) | (stats[:, 0] + stats[:, 2] == cols)
    touches |= stats[:, 1] + stats[:, 3] == rows
    if seeds_px:
        chosen = sorted({_region_of(seed, regions, touches) for seed in seeds_px})
    else:
        chosen = _odd_regions(regions, stats, touches, _half_line(closed))
    if not chosen:
        raise GeometryError("the drawn walls enclose nothing; survey.wall_gap_px closes gaps")
    inside = np.isin(regions, chosen).astype(np.uint8)
    half = _half_line(closed)
    return cv2.dilate(inside, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * half + 1, 2 * half + 1))).astype(bool)


def _odd_regions(regions: np.ndarray, stats: np.ndarray, touches: np.ndarray, half: int) -> list[int]:
    """Return the regions that an odd number of walls separates from the edge; label 0 is the walls."""
    rows, cols = regions.shape
    reach = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (4 * half + 5, 4 * half + 5))  # across one wall
    depth = {i: 0 for i in range(1, len(stats)) if touches[i]}
    layer, level = set(depth), 0
    while layer:
        level += 1
        near = cv2.dilate(np.isin(regions, list(layer)).astype(np.uint8), reach) > 0
        layer = {int(i) for i in np.unique(regions[near])} - set(depth) - {0}
        frame = [i for i in layer if stats[i, 2] > _FRAME * cols and stats[i, 3] > _FRAME * rows]
        if level == 1 and len(layer) == 1 and frame:
            level = 0
        depth |= dict.fromkeys(layer, level)
    return [i for i, walls in depth.items() if walls % 2 == 1]


def _region_of(seed: tuple[float, float], regions: np.ndarray, touches: np.ndarray) -> int:
    col, row = round(seed[0]), round(seed[1])
    if not (0 <= row < regions.shape[0] and 0 <= col < regions.shape[1]):
        raise GeometryError(
            f"survey.seeds_px: ({seed[0]:g}, {seed[1]:g}) lies beyond {regions.shape[1]} x {regions.shape[0]} px"
        )
    region = int(regions[row, col])
    if region == 0:
        raise GeometryError(f"survey.seeds_px: ({seed[0]:g}, {seed[1]:g}) lies on a wall")
    if touches[region]:
        raise GeometryError(
            f"survey.seeds_px: the region of ({seed[0]:g}, {seed[1]:g}) reaches the picture's edge; "
            "a wall has a gap wider than survey.wall_gap_px"
        )
    return region


def _half_line(lines: np.ndarray) -> int:
    """Return half the width of the drawn lines, px: twice the mean distance to paper over the pixels of the lines."""
    distance = cv2.distanceTransform(lines, cv2.DIST_L2, 3)
    return round(float(2 * distance[lines > 0].mean() - 0.5)) if lines.any() else 0


def _odd_size(gap_px: float) -> tuple[int, int]:
    size = 2 * int(np.ceil(gap_px / 2)) + 1
    return size, size
