"""Measures on a drawing: level or upright thin lines with an arrow at both ends."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.geometry.drawing.wall_lines import keep_crossed
from pipeline.types import Mask

_SHAFT_PX = 31  # the shortest measure; odd: an even kernel moves an opening by a pixel
_ALONG_PX = np.arange(3, 7)  # from the tip of an arrow, where its arms are judged
_THIN_PX, _CROSSED = 2, 0.5  # beside a thin line is paper, but for what it crosses and its figure
_REACH_PX = 8  # from the shaft, of what is judged
_SLOPE = 0.5  # of an arrow's arms
_CLEAR_PX = 4  # outside its arms is paper; the wall of a drift that ends at another has ink there


def drop_measures(lines: Mask) -> Mask:
    """Remove the lines of measures; walls that they cross stay."""
    rest = lines & ~_shafts(lines) & ~_shafts(lines.T).T
    return keep_crossed(lines, rest)


def _shafts(lines: Mask) -> Mask:
    """Mark the level lines between two arrows."""
    runs = cv2.morphologyEx(lines.astype(np.uint8), cv2.MORPH_OPEN, np.ones((1, _SHAFT_PX), np.uint8))
    ends = np.diff(np.pad(runs, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    found = np.zeros_like(lines)
    for (row, first), (_, past) in zip(np.argwhere(ends == 1), np.argwhere(ends == -1), strict=True):
        beside = lines[np.clip([row - _THIN_PX, row + _THIN_PX], 0, len(lines) - 1), first:past]
        if (beside.mean(axis=1) > _CROSSED).any():
            continue
        if _is_arrow(lines, row, first, 1) and _is_arrow(lines, row, past - 1, -1):
            found[max(0, row - 1) : row + 2, first:past] = True
    return found & (runs > 0)


def _is_arrow(lines: Mask, row: int, tip: int, side: int) -> bool:
    """Return whether an arrow has its tip at a place; its arms go back to a side."""
    cols = tip + side * _ALONG_PX
    if min(row, *cols) < _REACH_PX or row + _REACH_PX >= lines.shape[0] or max(cols) >= lines.shape[1]:
        return False
    arms = np.round(_SLOPE * _ALONG_PX).astype(int)
    for up in (-1, 1):
        at = row + up * arms
        near = np.stack([lines[at + off, cols] for off in (-1, 0, 1)]).any(axis=0)
        beyond = lines[at + up * _CLEAR_PX, cols]
        if not near.all() or beyond.all():
            return False
    return True
