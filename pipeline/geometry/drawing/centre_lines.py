"""Survey lines on a drawing: lines in the middle between two walls."""

from __future__ import annotations

import cv2
import numpy as np
from skimage.morphology import skeletonize

from pipeline.types import Mask

_REACH_PX = 64  # half of the widest drift, px
_CLEAR_PX = 2.0  # a ray starts this far outside its own line
_MIDDLE = 0.34  # least share of the distance between both walls that lies on one side
_MOST = 0.6  # of a line's pixels that lie in the middle
_SHORT_PX = 10  # shorter pieces are not judged
_OFF, _WIDE = 0.3, 1.7  # offset from the middle, of the local half width; that half width, of the typical one


def drop_centre_lines(lines: Mask) -> Mask:
    """Remove lines that have another line at the same distance on either side along most of their length."""
    skeleton = skeletonize(lines)
    rows, cols = np.nonzero(skeleton)
    if not len(rows):
        return lines
    to_paper = cv2.distanceTransform(lines.astype(np.uint8), cv2.DIST_L2, 5)
    start = to_paper[rows, cols] + _CLEAR_PX
    normal = _normals(lines, rows, cols)
    sides = np.stack([_clear_px(lines, rows, cols, side * normal, start) for side in (1, -1)])
    near, far = sides.min(axis=0), sides.max(axis=0)
    middle = np.isfinite(far) & (near >= _MIDDLE * (near + far))
    branch = cv2.filter2D(skeleton.astype(np.uint8), -1, np.ones((3, 3), np.uint8)) > 3
    pieces = skeleton & ~(cv2.dilate((skeleton & branch).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0)
    count, labels = cv2.connectedComponents(pieces.astype(np.uint8), connectivity=8)
    of_pixel = labels[rows, cols]
    size = np.maximum(np.bincount(of_pixel, minlength=count), 1)
    dropped = (np.bincount(of_pixel, middle, minlength=count) >= _MOST * size) & (size >= _SHORT_PX)
    dropped[0] = False
    _, nearest = cv2.distanceTransformWithLabels(
        (~skeleton).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    piece_of = np.zeros(int(nearest.max()) + 1, np.int32)
    piece_of[nearest[skeleton]] = labels[skeleton]
    return np.asarray(lines & ~dropped[piece_of[nearest]])


def _normals(lines: Mask, rows: np.ndarray, cols: np.ndarray) -> np.ndarray:
    """Return the direction (n, 2; column, row) across the lines at pixels, from the structure tensor."""
    soft = cv2.GaussianBlur(lines.astype(np.float32), (0, 0), 1.5)
    gx, gy = cv2.Sobel(soft, cv2.CV_32F, 1, 0), cv2.Sobel(soft, cv2.CV_32F, 0, 1)
    xx, yy, xy = (cv2.GaussianBlur(each, (0, 0), 3.0)[rows, cols] for each in (gx * gx, gy * gy, gx * gy))
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _clear_px(lines: Mask, rows: np.ndarray, cols: np.ndarray, direction: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return the distance (n,) px from pixels to the next line in a direction; infinite if there is none near."""
    thick = cv2.dilate(np.pad(lines, 1).astype(np.uint8), np.ones((2, 2), np.uint8))  # no ray slips through
    found = np.full(len(rows), np.inf)
    for step in range(_REACH_PX, 0, -1):
        at = start + step
        col = np.clip(np.round(cols + direction[:, 0] * at).astype(int) + 1, 0, thick.shape[1] - 1)
        row = np.clip(np.round(rows + direction[:, 1] * at).astype(int) + 1, 0, thick.shape[0] - 1)
        found[thick[row, col] > 0] = at[thick[row, col] > 0]
    return found


def in_the_middle(mask: Mask) -> Mask:
    """Mark the places inside workings that lie in the middle of a drift of ordinary width."""
    spine = skeletonize(mask)
    if not spine.any():
        return np.zeros_like(mask)
    half = cv2.distanceTransform(np.pad(mask, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
    off, nearest = cv2.distanceTransformWithLabels(
        (~spine).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    half_at = np.zeros(int(nearest.max()) + 1, np.float32)
    half_at[nearest[spine]] = half[spine]
    typical = float(np.median(half[spine]))
    local = half_at[nearest]
    return np.asarray(mask & (off <= _OFF * local) & (local <= _WIDE * typical))
