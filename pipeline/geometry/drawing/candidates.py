"""Which areas on a drawing may be workings, and which level of several they show."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.errors import GeometryError
from pipeline.geometry.drawing.doubts import LevelsError
from pipeline.types import Mask

Box = tuple[int, int, int, int]

_SHARE = 0.006  # of the drawing that workings cover at least
_REACHES = 0.2  # of the drawing's side that workings extend over at least
_MARGIN, _INNER = 0.04, 0.3  # of the drawing's side, and share that lies inside: a frame lies nearer to the edge
_RIVAL = 0.1  # of the largest drawing's area: a smaller one is a sample or a detail
_LISTED = 8  # plans that a message names
_COMPACT = 0.9  # share of its convex hull that a box, a circle or a patch fills


def find_plans(areas: Mask) -> list[int]:
    """Return the labels of the areas that may be workings, largest first: large, extended and not compact."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(areas.astype(np.uint8), connectivity=4)
    rows, cols = areas.shape
    inner = np.s_[
        round(_MARGIN * rows) : round((1 - _MARGIN) * rows), round(_MARGIN * cols) : round((1 - _MARGIN) * cols)
    ]
    found = []
    for k in range(1, len(stats)):
        left, top, width, height, area = stats[k]
        if area < _SHARE * areas.size or (width < _REACHES * cols and height < _REACHES * rows):
            continue
        if left <= 1 and top <= 1 and left + width >= cols - 1 and top + height >= rows - 1:
            continue
        if (labels[inner] == k).sum() < _INNER * area:  # a frame
            continue
        if area < _COMPACT * _hull_area(labels[top : top + height, left : left + width] == k):
            found.append(k)
    found.sort(key=lambda k: -stats[k, cv2.CC_STAT_AREA])
    return [k for k in found if stats[k, cv2.CC_STAT_AREA] >= _RIVAL * stats[found[0], cv2.CC_STAT_AREA]]


def _hull_area(piece: Mask) -> float:
    """Return the area, px2, of the convex hull of a piece's pixels; the ends of each row have the same hull."""
    rows = np.arange(len(piece))
    first, last = piece.argmax(axis=1), piece.shape[1] - 1 - piece[:, ::-1].argmax(axis=1)
    ends = np.concatenate([np.column_stack([first, rows]), np.column_stack([last, rows])])
    return float(cv2.contourArea(cv2.convexHull(ends.astype(np.int32))))


def choose_plan(areas: Mask, plans: list[int], level: int | None) -> tuple[Mask, list[Box]]:
    """Return the area of the chosen drawing and the boxes of all, by rows from the upper left."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(areas.astype(np.uint8), connectivity=4)
    height = max(stats[k, 3] for k in plans)
    order = sorted(plans, key=lambda k: (round((stats[k, 1] + stats[k, 3]) / height), stats[k, 0]))
    boxes = [(int(s[0]), int(s[1]), int(s[0] + s[2]), int(s[1] + s[3])) for s in (stats[k] for k in order)]
    if level is not None and not 1 <= level <= len(order):
        raise GeometryError(f"--level {level}: the drawing shows {len(order)} plans")
    if level is None and len(order) > 1:
        listed = list(enumerate(boxes, start=1))[:_LISTED]
        shown = "; ".join(f"{k}: columns {b[0]}-{b[2]}, rows {b[1]}-{b[3]}" for k, b in listed)
        shown += "; ..." if len(boxes) > _LISTED else ""
        raise LevelsError(
            f"the drawing shows {len(order)} plans ({shown}); --level N chooses one", np.isin(labels, order)
        )
    return labels == order[(level or 1) - 1], boxes


def largest_area(areas: Mask, plans: list[int]) -> int:
    """Return the pixels of the largest drawing; 0 if there is none."""
    _, _, stats, _ = cv2.connectedComponentsWithStats(areas.astype(np.uint8), connectivity=4)
    return int(stats[plans[0], cv2.CC_STAT_AREA]) if plans else 0


def part(areas: Mask, label: int) -> Mask:
    """Return the area of a label."""
    return np.asarray(cv2.connectedComponents(areas.astype(np.uint8), connectivity=4)[1] == label)


def largest_part(mask: Mask) -> Mask:
    """Return the largest piece of a mask."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    if len(stats) < 2:
        return mask
    return np.asarray(labels == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax()))
