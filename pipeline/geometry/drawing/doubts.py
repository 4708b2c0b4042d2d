"""Reasons to doubt the workings that were found on a drawing."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.errors import GeometryError
from pipeline.geometry.drawing.centre_lines import in_the_middle
from pipeline.geometry.drawing.wall_lines import drop_straight, grown, margin_px, stroke_px, unexplained_px
from pipeline.geometry.outline.binarize import disc
from pipeline.types import Mask

_AGREE, _SAME = 0.97, 0.95  # IoU of the workings with both gaps, and without grey lines
_UNEXPLAINED = 2.5  # drift widths of line inside the workings that no reading explains
_RULED = 0.12  # of the drawing's side: a level or upright line this long is a piece of a grid
_OTHER, _RULER_PX = 0.3, 10  # extent of another drawing, of that of the workings; width of a ruled line
_BOX = 0.7  # covered share of a box's sides
_OUTLINED, _NEAR_PX = 0.95, 4.0  # share of the border that has a line, and how near, px
_OFF_PX, _OFF = 2.5, 0.08  # from the border of the workings to the edge of a wall, and share of walls farther from it
_AT_BORDER, _INSIDE = 0.4, 0.3  # drift widths from the border to what may be a wall, outside and inside
_CIRCLE_PX = 4.0
_PIECE, _NARROW, _WIDE = 1.0, 0.5, 0.7  # area of a lost piece, in drift widths squared; limits of half its width
_SLIVER = 0.15  # half the thickness of a piece, in drift widths; compression leaves slivers beside lines
_LOST = 0.6  # area of drifts between lines that are not taken, in drift widths squared
_FILLED = 0.5  # of what lines enclose
_CELLS = 0.97  # IoU of filled workings with all small cells of paper in them, and with none
_BESIDE_PX, _FAR = (
    6.0,
    0.01,
)  # half the thickest outline or letter, and share of the workings that is farther from filling
_THICK = 0.5  # area of other ink than the filling, thicker than lines, in drift widths squared


class DrawingError(GeometryError):
    """The workings on a drawing are in doubt; `found` (rows, cols) bool marks what was found."""

    def __init__(self, message: str, found: Mask) -> None:
        super().__init__(message)
        self.found = found


class LevelsError(DrawingError):
    """A drawing shows several levels, and none is stated."""


class BesideError(DrawingError):
    """Workings without any other doubt have another drawing, or a title in large letters, beside them."""


def more_helpful(doubt: GeometryError | None, error: GeometryError) -> GeometryError:
    """Return which of the doubts about two readings is shown: the first, unless it says less of the way on.

    A reading beside which something lies is right after a crop, and has passed all other checks. A doubt that shows
    what was found says more than one that does not.
    """
    if doubt is None or (isinstance(error, DrawingError) and not isinstance(doubt, DrawingError)):
        return error
    return error if isinstance(error, BesideError) and not isinstance(doubt, LevelsError) else doubt


def require_agreement(mask: Mask, other: Mask) -> None:
    """Refuse workings that another reading gives otherwise."""
    iou = float((mask & other).sum() / max(1, (mask | other).sum()))
    if iou < _AGREE:
        raise DrawingError(
            f"the workings depend on which gaps in walls are closed (IoU {iou:.2f} between two readings, at least "
            f"{_AGREE}); --seed COL,ROW names a place inside, --gap PX states the widest gap",
            mask,
        )


def require_same(mask: Mask, black: Mask) -> None:
    """Refuse workings between dark lines that black lines alone give otherwise."""
    iou = float((mask & black).sum() / max(1, (mask | black).sum()))
    if iou < _SAME:
        raise DrawingError(
            f"the workings depend on whether grey lines are walls (IoU {iou:.2f} between two readings, at least "
            f"{_SAME}); --ignore R,G,B leaves out a colour, --seed COL,ROW names a place inside",
            mask,
        )


def require_explained(lines: Mask, mask: Mask, width: float, reach_px: float) -> None:
    """Refuse workings with long lines inside or beside them that are no wall of theirs."""
    length = unexplained_px(lines & ~in_the_middle(mask), mask, width, reach_px)
    if length > _UNEXPLAINED * width:
        raise DrawingError(
            f"{length:.0f} px of lines at the workings are no wall of theirs; --crop COL0,ROW0,COL1,ROW1 or "
            "--ignore R,G,B leaves out what is no wall, --seed COL,ROW names a place inside",
            mask,
        )


def require_outlined(lines: Mask, mask: Mask) -> None:
    """Refuse workings whose border has no line along much of it."""
    border = mask & grown(~mask, 1.0)
    share = float(grown(lines, _NEAR_PX)[border].mean())
    if share < _OUTLINED:
        raise DrawingError(
            f"lines are drawn along {100 * share:.0f} % of the workings' border, at least {100 * _OUTLINED:.0f} % are "
            "needed; --seed COL,ROW names a place inside, --gap PX states the widest gap",
            mask,
        )


def require_on_walls(lines: Mask, mask: Mask, width: float) -> None:
    """Refuse workings whose border leaves the walls: it cuts a corner, or passes beside a wall."""
    from_border = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)
    from_border += cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5)
    walls = lines & (from_border <= np.where(mask, _INSIDE, _AT_BORDER) * width)
    off = float((from_border[walls] > stroke_px(lines) / 2 + _OFF_PX).mean()) if walls.any() else 1.0
    if off > _OFF:
        raise DrawingError(
            f"{100 * off:.0f} % of the lines at the workings' border are no wall of theirs or are left by it, at most "
            f"{100 * _OFF:.0f} % may; --crop COL0,ROW0,COL1,ROW1 or --ignore R,G,B leaves out what is no wall, "
            "--seed COL,ROW names a place inside",
            mask,
        )


def require_whole(areas: Mask, mask: Mask, width: float, ink: Mask) -> None:
    """Refuse a filled area beside which another piece of the same filling lies: a label or a line may part them.

    Beside is what is not farther than a drift's width, or joined to the workings by ink, such as an outline.
    """
    beside = (areas & ~grown(mask, _NEAR_PX)).astype(np.uint8)
    beside = cv2.morphologyEx(beside, cv2.MORPH_OPEN, disc(_SLIVER * width))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(beside)
    outlines = drop_straight(ink)
    _, groups = cv2.connectedComponents(outlines.astype(np.uint8), connectivity=8)
    joined = np.unique(groups[outlines & grown(mask, _NEAR_PX)])
    near = np.unique(labels[grown(mask, width) | np.isin(groups, joined[joined > 0])])
    left = max(near[near > 0], key=lambda k: stats[k, cv2.CC_STAT_AREA], default=0)
    if left and stats[left, cv2.CC_STAT_AREA] > _PIECE * width**2:
        col, row, *_ = stats[left]
        raise DrawingError(
            f"a piece of {stats[left, cv2.CC_STAT_AREA]} px with the same filling lies beside the workings, at "
            f"({col}, {row}), and is not joined to them; --gap PX closes gaps, --crop COL0,ROW0,COL1,ROW1 leaves out "
            "what is no workings",
            mask,
        )


def require_filled(filling: Mask, with_cells: Mask, without: Mask, mask: Mask) -> None:
    """Refuse filled workings that depend on small cells of paper, or that lie far from their filling."""
    iou = float((with_cells & without).sum() / max(1, (with_cells | without).sum()))
    if iou < _CELLS:
        raise DrawingError(
            f"the workings depend on whether small cells of paper belong to them (IoU {iou:.2f} between two readings, "
            f"at least {_CELLS}); --ignore R,G,B leaves out the colour of lines that part them from the paper",
            mask,
        )
    far = float((mask & ~grown(filling, _BESIDE_PX)).sum() / max(1, mask.sum()))
    if far > _FAR:
        raise DrawingError(
            f"{100 * far:.1f} % of the workings lie more than {_BESIDE_PX:g} px from their filling, at most "
            f"{100 * _FAR:g} % may; --ignore R,G,B leaves out a colour, --crop COL0,ROW0,COL1,ROW1 what is no workings",
            mask,
        )


def require_one_filling(areas: Mask, mask: Mask, width: float) -> None:
    """Refuse filled workings beside which another area lies, thicker than lines: it may be a drift in another shade."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats((areas & ~grown(mask, _NEAR_PX)).astype(np.uint8))
    near = np.unique(labels[grown(mask, width)])
    other = max(near[near > 0], key=lambda k: stats[k, cv2.CC_STAT_AREA], default=0)
    if other and stats[other, cv2.CC_STAT_AREA] > _THICK * width**2:
        col, row, *_, size = stats[other]
        raise DrawingError(
            f"an area of {size} px with another filling lies beside the workings, at ({col}, {row}); "
            "--ignore R,G,B leaves out a colour, --crop COL0,ROW0,COL1,ROW1 what is no workings",
            mask,
        )


def require_no_filling(areas: Mask, mask: Mask) -> None:
    """Refuse workings between lines that are filled: the filling was not understood."""
    share = float(areas[mask].mean())
    if share > _FILLED:
        raise DrawingError(
            f"{100 * share:.0f} % of what the lines enclose is filled, but not in one shade; --ignore R,G,B leaves out "
            "a colour, --crop COL0,ROW0,COL1,ROW1 what is no workings",
            mask,
        )


def require_taken(lines: Mask, mask: Mask, width: float, reach_px: float) -> None:
    """Refuse workings if two of their lines run on beside each other like walls of a drift that was not taken.

    Lines within `reach_px` of each other count as connected.
    """
    near = grown(mask, margin_px(width))
    _, groups = cv2.connectedComponents(grown(lines, reach_px).astype(np.uint8), connectivity=4)
    touching = np.unique(groups[lines & near])
    reach = int(_WIDE * width) + 2
    left = np.pad(lines & ~near & np.isin(groups, touching[touching > 0]), reach)
    between = ~grown(~grown(left, _WIDE * width), _WIDE * width)[reach:-reach, reach:-reach] & ~near
    side = max(3, int(_NARROW * width))
    drifts = cv2.morphologyEx(between.astype(np.uint8), cv2.MORPH_OPEN, np.ones((side, side), np.uint8))
    if drifts.sum() > _LOST * width**2:
        _, _, stats, _ = cv2.connectedComponentsWithStats(drifts)
        col, row, *_ = stats[1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())]
        raise DrawingError(
            f"two lines of the workings run on at ({col}, {row}) like walls of a drift, which is not enclosed; "
            "--seed COL,ROW names a place inside, --gap PX states the widest gap",
            mask,
        )


def require_alone(lines: Mask, mask: Mask, join_px: float = 0.0) -> None:
    """Refuse workings beside a large drawing or title: lines as extended as the workings that are no box and no ruler.

    Lines within twice `join_px` of each other count as one: walls have gaps.
    """
    others = drop_straight(lines & ~grown(mask, 6.0), _RULED)
    joined = grown(others, join_px) if join_px else others
    _, labels, stats, _ = cv2.connectedComponentsWithStats(joined.astype(np.uint8), connectivity=8)
    _, _, cols, rows = cv2.boundingRect(mask.astype(np.uint8))
    for k, (left, top, width, height, _) in enumerate(stats[1:], start=1):
        if max(width, height) < _OTHER * max(cols, rows) or min(width, height) <= _RULER_PX:
            continue
        piece = labels[top : top + height, left : left + width] == k
        border = [piece[:4].any(axis=0), piece[-4:].any(axis=0), piece[:, :4].any(axis=1), piece[:, -4:].any(axis=1)]
        if np.mean(np.concatenate(border)) < _BOX and not _is_circle(piece):
            raise BesideError(
                f"another drawing of {width} x {height} px, or a title, lies beside the workings, at ({left}, {top}); "
                "--crop COL0,ROW0,COL1,ROW1 leaves it out",
                mask,
            )


def _is_circle(piece: Mask) -> bool:
    """Return whether a piece of line is a circle, such as that of a north arrow."""
    rows, cols = piece.shape
    points = np.argwhere(piece) - (np.array(piece.shape) - 1) / 2
    radius = np.hypot(*points.T)
    return abs(rows - cols) <= 3 and bool(np.abs(radius - rows / 2).max() <= _CIRCLE_PX)
