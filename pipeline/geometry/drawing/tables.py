"""Tables on a drawing: title blocks and legends, boxes of level and upright lines with letters in them."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.types import Mask

_SIDE_PX = 61  # the shortest side; odd: an even kernel moves an opening by a pixel
_CLOSED, _PEN_PX = 0.95, 4  # share of each side that one straight line covers, among this many; walls waver
_LARGEST = 0.25  # of the drawing
_WORD_PX, _LETTER_PX, _LEAST_PX = 70, 14, 4
_NARROW = 4.0  # variance along a stroke of rock hatching, of that across it
_LETTERS, _MOSTLY = 8, 0.6  # pieces that are letters or words, and their share of all small pieces


def drop_tables(lines: Mask) -> Mask:
    """Remove boxes of straight lines that hold letters, with all that is in them.

    A pillar is no table: it holds no text, and if it is hatched, then with narrow strokes.
    """
    mask = lines.astype(np.uint8)
    straight = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((1, _SIDE_PX), np.uint8))
    straight |= cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((_SIDE_PX, 1), np.uint8))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(straight, connectivity=8)
    kept = lines.copy()
    for k, (left, top, width, height, _) in enumerate(stats[1:], start=1):
        if min(width, height) < _SIDE_PX or width * height > _LARGEST * lines.size:
            continue
        box = np.s_[top : top + height, left : left + width]
        piece = labels[box] == k
        across, along = piece.mean(axis=1), piece.mean(axis=0)
        sides = [across[:_PEN_PX], across[-_PEN_PX:], along[:_PEN_PX], along[-_PEN_PX:]]
        if min(side.max() for side in sides) >= _CLOSED and _holds_text(lines[box], piece):
            kept[box] = False
    return kept


def _holds_text(lines: Mask, table: Mask) -> bool:
    """Return whether lines hold letters that do not touch a table's own."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(lines.astype(np.uint8), connectivity=8)
    touching = set(np.unique(labels[table]).tolist())
    letters = small = 0
    for k, (left, top, width, height, _) in enumerate(stats[1:], start=1):
        if k in touching or max(width, height) < _LEAST_PX or height > _LETTER_PX or width > _WORD_PX:
            continue
        points = np.argwhere(labels[top : top + height, left : left + width] == k).astype(float)
        spread = np.linalg.eigvalsh(np.cov(points.T))
        small += 1
        letters += bool(width > _LETTER_PX or spread[1] < _NARROW * spread[0])
    return letters >= _LETTERS and letters >= _MOSTLY * small
