"""Close gaps in walls that a drawing shows as lines: ends of lines are joined to those that continue them."""

from __future__ import annotations

import cv2
import numpy as np
from scipy.spatial import cKDTree
from skimage.morphology import skeletonize

from pipeline.geometry.outline.binarize import fill_islands
from pipeline.types import Mask, Points2

_BACK_PX = 9  # length of line behind an end that gives its direction
_TURN_RAD = np.radians(95.0)  # most that a bridge turns at one of its ends
_TURNS_RAD = np.radians(105.0)  # and at both; a gap at a corner turns by 90 deg in all
_TO_SIDE = 0.6  # of the widest gap: an end reaches the side of a line over less
_CONE_RAD = np.radians([0, -10, 10, -20, 20, -30, 30])
_CLEAR_PX = 4.0  # an end's own line, thick as it is, lies nearer
_HOLE_PX2 = 40.0  # smaller holes in lines are those of letters and of the signs of stations
_RING = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))


def bridge_gaps(lines: Mask, widest_px: float) -> Mask:
    """Draw a bridge across each gap of at most `widest_px` between two ends of lines that continue each other.

    An end is joined once, and to the end that is nearest and straightest ahead.
    """
    ends, headings = _find_ends(skeletonize(lines))
    if len(ends) < 2:
        return lines
    pairs = cKDTree(ends).query_pairs(widest_px, output_type="ndarray")
    across = ends[pairs[:, 1]] - ends[pairs[:, 0]]
    length = np.maximum(np.hypot(*across.T), 1e-9)
    turns = np.stack([_angle(headings[pairs[:, 0]], across), _angle(headings[pairs[:, 1]], -across)])
    allowed = (turns.max(axis=0) <= _TURN_RAD) & (turns.sum(axis=0) <= _TURNS_RAD)
    cost = length * (1 + turns.sum(axis=0))
    bridged, used = lines.astype(np.uint8), np.zeros(len(ends), bool)
    for k in np.argsort(cost):
        one, other = pairs[k]
        if allowed[k] and not used[one] and not used[other]:
            used[[one, other]] = True
            cv2.line(bridged, *(tuple(int(v) for v in ends[e]) for e in (one, other)), 1, 2)
    for k in np.flatnonzero(~used):
        side = _side_ahead(lines, ends[k], headings[k], _TO_SIDE * widest_px)
        if side is not None:
            cv2.line(bridged, tuple(int(v) for v in ends[k]), side, 1, 2)
    return bridged > 0


def _side_ahead(lines: Mask, end: np.ndarray, heading: np.ndarray, reach_px: float) -> tuple[int, int] | None:
    """Return the nearest pixel (column, row) of a line ahead of an end: at a corner a gap may end at a line's side."""
    direction = np.arctan2(heading[1], heading[0]) + _CONE_RAD
    for step in np.arange(_CLEAR_PX, reach_px):
        at = np.round(end + step * np.column_stack([np.cos(direction), np.sin(direction)])).astype(int)
        at = at[(at >= 0).all(axis=1) & (at[:, 0] < lines.shape[1]) & (at[:, 1] < lines.shape[0])]
        hit = at[lines[at[:, 1], at[:, 0]]]
        if len(hit):
            return int(hit[0, 0]), int(hit[0, 1])
    return None


def keep_cycles(lines: Mask) -> Mask:
    """Return the middle of all lines that belong to a closed curve, three pixels thick: walls are closed.

    Branches with a free end, such as measures, letters and lines that end in a drift, are removed, and so is what is
    smaller than a letter.
    """
    skeleton = skeletonize(fill_islands(lines, _HOLE_PX2))
    rows, cols = np.nonzero(np.pad(skeleton, 1))
    left = set(zip(rows.tolist(), cols.tolist(), strict=True))
    waiting = list(left)
    while waiting:
        row, col = waiting.pop()
        if (row, col) not in left:
            continue
        near = [at for r, c in _RING if (at := (row + r, col + c)) in left]
        if len(near) < 2 or (len(near) == 2 and abs(near[0][0] - near[1][0]) + abs(near[0][1] - near[1][1]) == 1):
            left.discard((row, col))
            waiting.extend(near)
    kept = np.zeros(lines.shape, np.uint8)
    if left:
        places = np.array(list(left)) - 1
        kept[tuple(places.T)] = 1
    return cv2.dilate(kept, np.ones((3, 3), np.uint8)) > 0


def _angle(one: Points2, other: Points2) -> np.ndarray:
    """Return the angles (n,) rad between vectors (n, 2)."""
    cross = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    return np.abs(np.arctan2(cross, (one * other).sum(axis=1)))


def _find_ends(skeleton: Mask) -> tuple[Points2, Points2]:
    """Return the ends (n, 2; column, row) of a skeleton's lines, px, and the directions in which they point."""
    padded = np.pad(skeleton, 1)
    count = cv2.filter2D(padded.astype(np.uint8), -1, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_CONSTANT)
    ends, headings = [], []
    for row, col in np.argwhere(padded & (count == 2)):
        path = _walk(padded, (int(row), int(col)))
        if len(path) >= 3:
            ends.append((col - 1.0, row - 1.0))
            headings.append((path[0][1] - path[-1][1], path[0][0] - path[-1][0]))
    return np.array(ends, float).reshape(-1, 2), np.array(headings, float).reshape(-1, 2)


def _walk(skeleton: Mask, start: tuple[int, int]) -> list[tuple[int, int]]:
    """Return the pixels (row, column) of a line from its end to the first branch, at most nine."""
    path = [start]
    while len(path) < _BACK_PX:
        row, col = path[-1]
        ahead = [(row + r, col + c) for r, c in _RING if skeleton[row + r, col + c] and (row + r, col + c) not in path]
        ahead = [at for at in ahead if len(path) < 2 or max(abs(at[0] - path[-2][0]), abs(at[1] - path[-2][1])) > 1]
        if len(ahead) != 1:
            break
        path.append(ahead[0])
    return path
