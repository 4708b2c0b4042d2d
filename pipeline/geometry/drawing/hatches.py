"""Find workings that a drawing shows as hatched areas within an outline."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.geometry.drawing.doubts import DrawingError, require_whole
from pipeline.geometry.drawing.fills import ridge_half_width
from pipeline.geometry.drawing.wall_lines import find_straight, grown
from pipeline.geometry.outline.binarize import disc
from pipeline.types import Image, Mask

_CELL_PX = 4.0  # paper between hatch lines is nowhere farther from a line
_CORNER_PX = 40  # depth of narrow paper outside, as in a corner or between strokes
_LEAK_PX = 12  # the same, if an outline may be broken
_STROKE_PX = 3.0  # half the thickness of what is an area and no line
_CORE_PX = 5.0  # inside, past the outline
_BARE = 0.85  # drift widths of border without an outline in one place: less than across a drift
_DARKER, _OUTLINED = 1.4, 0.95  # an outline's ink, of that of the hatching, and the share of the border that has it
_UP_DOWN = np.ones((3, 1), np.uint8)


def find_hatched(ink: Mask, through_ruled: bool = True, corner_px: int = _CORNER_PX) -> Mask:
    """Return the areas in which lines leave only narrow cells of paper. A wall is the middle of its line.

    Wide paper is outside, and so is narrow paper that it reaches within `corner_px`, with `through_ruled` also across
    a long level or upright line: a grid bounds no area. Each pixel of ink goes to the nearest paper: lines between two
    cells to the area, strokes in the rock to the outside.
    """
    ink = np.pad(ink, 1)
    paper = (~ink).astype(np.uint8)
    distance = cv2.distanceTransform(np.pad(paper, 8, constant_values=1), cv2.DIST_L2, 5)[8:-8, 8:-8]
    passable = [paper | line for line in find_straight(ink)] if through_ruled else []  # across a ruled line
    outside = (distance > _CELL_PX).astype(np.uint8)
    for _ in range(corner_px):
        reached = cv2.dilate(outside & paper, disc(1.0)) & paper
        for passed, across in zip(passable, (_UP_DOWN, _UP_DOWN.T), strict=False):
            reached |= cv2.dilate(outside & passed, across) & passed
        if cv2.norm(reached, outside, cv2.NORM_INF) == 0:
            break
        outside = reached
    outside &= paper
    _, nearest = cv2.distanceTransformWithLabels(1 - paper, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    is_cell = np.zeros(int(nearest.max()) + 1, np.uint8)
    is_cell[nearest[paper > 0]] = (paper & (1 - outside))[paper > 0]
    return cv2.morphologyEx(is_cell[nearest][1:-1, 1:-1], cv2.MORPH_OPEN, disc(_STROKE_PX)) > 0


def require_hatch_outlined(picture: Image, ink: Mask, mask: Mask) -> None:
    """Refuse a hatched area whose border has no outline that is darker or thicker than the hatching.

    Where an outline is broken, paper between hatch lines is outside far into the hatching, and the rest ends at a hatch
    line. Less is lost if the outside goes on less far.

    Raises
    ------
    DrawingError
        With the share of the border that has an outline, or the place of what was lost.
    """
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    darkness = cv2.dilate(cv2.blur((255 - grey).astype(np.float32), (3, 3)), np.ones((3, 3), np.uint8))
    core = mask & ~grown(~mask, _CORE_PX)
    outlined = darkness >= _DARKER * (np.median(darkness[core]) if core.any() else 255.0)
    border = mask & grown(~mask, 1.0)
    share = float(outlined[border].mean())
    _, _, bare, _ = cv2.connectedComponentsWithStats((border & ~outlined).astype(np.uint8))
    longest, width = int(bare[1:, cv2.CC_STAT_AREA].max(initial=0)), 2 * ridge_half_width(mask)
    if share < _OUTLINED or longest > _BARE * width:
        raise DrawingError(
            f"an outline runs along {100 * share:.0f} % of a hatched area, at least {100 * _OUTLINED:.0f} % are "
            f"needed, and is missing along {longest} px; --crop COL0,ROW0,COL1,ROW1 leaves out what is no workings",
            mask,
        )
    require_whole(find_hatched(ink, corner_px=_LEAK_PX), mask, width, ink)
