"""Scale bars in pieces: dark and light ones in turn, in one row or in two."""

from __future__ import annotations

import cv2
import numpy as np

FILLED = 0.85  # smallest filled share of the bounding box of a bar or a piece; a slanted bar fills less
_PIECE_PX = 48  # greatest height of a light piece of a bar
_LEAST_PX = 4  # height of a piece of a bar; dashes of lines are thinner
_EQUAL, _EQUAL_PX = 0.1, 2  # difference of a light piece from a dark one beside it, of its length and px
_MOST_PIECES = 12  # dark ones of a bar; a dashed line has more
_TICK, _LINE = 0.85, 0.4  # dark share of a column of a tick, and of a line between ticks
_HALF = (0.3, 0.7)  # dark share of a column of a bar in two rows
_COLUMNS = 0.9  # of such a bar are half dark


def without_holes(dark: np.ndarray) -> np.ndarray:
    """Fill the light pieces of flat regions: those of a bar in alternating pieces with an outline."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(1 - dark, connectivity=4)
    rows, cols = dark.shape
    inside = (stats[:, 0] > 0) & (stats[:, 1] > 0)
    inside &= (stats[:, 0] + stats[:, 2] < cols) & (stats[:, 1] + stats[:, 3] < rows)
    width, height, area = stats[:, 2], stats[:, 3], stats[:, 4]
    holes = inside & (area >= FILLED * width * height) & (height <= _PIECE_PX) & (width >= height)
    holes[0] = False
    return np.where(holes[labels], 1, dark).astype(np.uint8) if count > 1 else dark


def with_pieces_joined(dark: np.ndarray) -> np.ndarray:
    """Fill the light pieces between dark ones of a bar without an outline, in one row or in two.

    A light piece is as long as a dark one beside it: any other gap is one in a broken bar.

    Parameters
    ----------
    dark : (rows, cols) uint8
        1 is dark.
    """
    _, labels, stats, _ = cv2.connectedComponentsWithStats(dark)
    joined = dark.copy()
    width, height, area = stats[:, 2], stats[:, 3], stats[:, 4]
    is_half = (width > height) & (height >= 2 * _LEAST_PX) & (area < FILLED * width * height)
    is_half &= area > _HALF[0] * width * height
    is_half[0] = False
    for k in np.flatnonzero(is_half):
        left, top, cols, rows = stats[k, :4]
        if _is_half(labels[top : top + rows, left : left + cols] == k):
            joined[top : top + rows, left : left + cols] = 1
    for chain in _chains(stats):
        left, top, _, height = chain[0][:4]
        joined[top : top + height, left : chain[-1][0] + 1] = 1
    return joined


def is_piece_beside(piece: np.ndarray, bar: np.ndarray) -> bool:
    """Return whether a region is a piece of a bar, by their boxes and areas (5,) px; digits beside a bar are none."""
    is_full = piece[4] >= FILLED * piece[2] * piece[3]
    return bool(is_full and _is_in_row(piece, bar))


def tick_distance_px(part: np.ndarray) -> float:
    """Return the distance of the middles of the ticks of a line between two ticks, px; 0 if it is none.

    Parameters
    ----------
    part : (rows, cols) bool
        A dark region in its box.
    """
    share = part.mean(axis=0)
    line = np.flatnonzero(share < _TICK)  # the columns between the ticks
    if not len(line) or len(line) != line[-1] - line[0] + 1 or share[line].max() > _LINE or not share[line].all():
        return 0.0
    left, right = int(line[0]), len(share) - 1 - int(line[-1])
    return len(share) - (left + right) / 2 if 0 < left <= part.shape[0] and 0 < right <= part.shape[0] else 0.0


def _is_in_row(one: np.ndarray, other: np.ndarray) -> bool:
    within = max(1.0, _EQUAL * float(other[3]))
    return bool(abs(one[1] - other[1]) <= within and abs(one[1] + one[3] - other[1] - other[3]) <= within)


def _is_half(part: np.ndarray) -> bool:
    """Return whether each of two rows of a region is dark where the other is light."""
    share, middle = part.mean(axis=0), len(part) // 2
    upper, lower = part[:middle].mean(axis=0) > 0.5, part[-middle:].mean(axis=0) > 0.5
    is_half = (share >= _HALF[0]) & (share <= _HALF[1]) & (upper != lower)
    return bool(is_half.mean() >= _COLUMNS and upper.any() and lower.any())


def _chains(stats: np.ndarray) -> list[list[np.ndarray]]:
    """Return dark pieces in one row with light pieces between them, each as long as a dark one beside it."""
    width, height, area = stats[:, 2], stats[:, 3], stats[:, 4]
    is_piece = (height >= _LEAST_PX) & (width >= height) & (area >= FILLED * width * height)
    is_piece[0] = False
    pieces = stats[is_piece].astype(int)
    chains: dict[int, list[list[np.ndarray]]] = {}  # by the row in which they begin
    for piece in pieces[np.argsort(pieces[:, 0], kind="stable")]:
        top, within = int(piece[1]), max(1, int(_EQUAL * piece[3]))
        near = [chain for row in range(top - within, top + within + 1) for chain in chains.get(row, ())]
        chain = next((chain for chain in near if _goes_on(chain[-1], piece)), None)
        if chain is None:
            chains.setdefault(top, []).append([piece])
        else:
            chain.append(piece)
    return [chain for row in chains.values() for chain in row if 1 < len(chain) <= _MOST_PIECES]


def _goes_on(last: np.ndarray, piece: np.ndarray) -> bool:
    gap = piece[0] - last[0] - last[2]
    is_equal = any(abs(gap - side) <= max(_EQUAL_PX, _EQUAL * side) for side in (last[2], piece[2]))
    return bool(gap > 0 and is_equal and _is_in_row(piece, last))
