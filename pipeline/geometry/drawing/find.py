"""Find the workings on a drawing: areas or lines, one level of several, and reasons to doubt the finding."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.errors import GeometryError
from pipeline.geometry.drawing.candidates import Box, choose_plan, find_plans, largest_area, largest_part, part
from pipeline.geometry.drawing.centre_lines import drop_centre_lines
from pipeline.geometry.drawing.doubts import (
    LevelsError,
    more_helpful,
    require_agreement,
    require_alone,
    require_explained,
    require_filled,
    require_no_filling,
    require_on_walls,
    require_one_filling,
    require_outlined,
    require_same,
    require_taken,
    require_whole,
)
from pipeline.geometry.drawing.fills import (
    fill_shade,
    find_areas,
    find_filled,
    find_ink,
    find_shade,
    ridge_half_width,
    trim,
)
from pipeline.geometry.drawing.gaps import bridge_gaps, keep_cycles
from pipeline.geometry.drawing.hatches import find_hatched, require_hatch_outlined
from pipeline.geometry.drawing.measures import drop_measures
from pipeline.geometry.drawing.tables import drop_tables
from pipeline.geometry.drawing.wall_lines import DrawnWalls, drop_letters, drop_ruled, drop_small, drop_straight, grown
from pipeline.types import Image, Mask

_CHROMA = 40  # lines in colour are annotation, as elsewhere
_HATCH_PX, _HATCH = 3.6, 0.33  # hatching: distance to the nearest line, px and of half the drifts' width
_PARALLEL = 0.15  # coherence of its directions
_GAPS = (0.23, 0.31)  # of the drifts' width: half the widest gap that is closed, tried twice
_JOINED_PX = 5.0  # half of a gap in the walls of another drawing
_LETTER_PX = 14.0  # smaller pieces are letters, dashes and hatching
_NARROWEST_PX = 8.0
_WIDEST_GAP_PX = 24.0
_CLOSED_PX, _CLOSED_GAPS = 2.0, (0.08, 0.22)  # the same for walls that are closed curves
_REACHES_PX = (7.0, 5.0, 9.0)
_BESIDE_PX = 5.0  # from the workings, where two readings are compared
_SAME_LINES = 0.98  # of the dark pixels belong to black lines: then there are no others
_DARK = 185  # lines with their soft edges
_BLACK = 80  # darkness of a black line of one pixel after a blur of one pixel is 102; that of a grey one up to 66
_NOTHING = (
    "no filled, hatched or enclosed area looks like workings; --crop COL0,ROW0,COL1,ROW1 leaves out the rest, "
    "--seed COL,ROW names a place inside them"
)


@dataclass(frozen=True)
class _Ink:
    """All ink (rows, cols), its filled areas, those of narrow cells, and whether the latter are hatched."""

    mask: Mask
    filled: Mask
    closed: Mask
    hatched: bool


@dataclass(frozen=True)
class _Walls:
    """What may be walls, all lines (rows, cols), and half of the gaps that are closed: first px, then of the width."""

    mask: Mask
    lines: Mask
    reaches_px: tuple[float, ...]
    gaps: tuple[float, float]


@dataclass(frozen=True)
class DrawingReading:
    """The workings (rows, cols) of one level, how they are drawn, and the boxes of all levels on the drawing."""

    mask: Mask
    walls: str
    boxes: list[Box]
    width_px: float


def read_drawing(picture: Image, level: int | None) -> DrawingReading:
    """Find the workings on a drawing with dark ink on light paper.

    Parameters
    ----------
    picture : (rows, cols, 3) uint8
    level : int or None
        Which plan of several, from 1, by rows from the upper left.

    Raises
    ------
    GeometryError
        If nothing looks like workings, several plans do and no level is stated, or the finding is doubtful. The
        message names the option that settles it.
    """
    ink = _ink_of(picture)
    try:
        area = _read_area(picture, ink, level)
        if area is not None:
            return area
    except LevelsError:
        raise
    except GeometryError as error:
        doubt = error
    else:
        return _read_lines(picture, ink, level)
    try:
        return _read_lines(picture, ink, level)
    except GeometryError as error:
        raise more_helpful(doubt, error) from None


def _ink_of(picture: Image) -> _Ink:
    ink = find_ink(picture)
    closed = find_hatched(ink)
    return _Ink(ink, find_areas(ink), closed, _is_hatched(picture, ink, closed))


def _read_area(picture: Image, ink: _Ink, level: int | None) -> DrawingReading | None:
    """Read workings drawn as a filled or hatched area; None if no area looks like workings."""
    filled, closed = ink.filled, ink.closed
    plain, dense = find_plans(filled), find_plans(closed)
    share = 1 if ink.hatched else 2  # outlines may be thick enough for areas
    if plain and largest_area(closed, dense) < share * largest_area(filled, plain):
        shade = fill_shade(picture, part(filled, plain[0]))
        if shade is not None:
            return _filled_reading(picture, ink.mask, filled, shade, level)
    doubt: GeometryError | None = None
    for through_ruled in (True, False):  # a straight wall would be taken for a grid
        areas = closed if through_ruled else find_hatched(ink.mask, False)
        if ink.hatched if through_ruled else _is_hatched(picture, ink.mask, areas):
            try:
                return _area_reading(picture, ink.mask, areas, level, "hatched")
            except GeometryError as error:
                doubt = more_helpful(doubt, error)
    if doubt is not None:
        raise doubt
    return None


def _filled_reading(picture: Image, ink: Mask, thick: Mask, shade: np.ndarray, level: int | None) -> DrawingReading:
    """Read workings of one colour (3,), and doubt them if small cells of paper or other areas of ink may matter."""
    found = _area_reading(picture, ink, find_filled(picture, shade), level, "filled")
    near = grown(found.mask, _BESIDE_PX)
    with_cells, without = (
        largest_part(trim(find_filled(picture, shade, cells) & near, found.width_px)) for cells in (True, False)
    )
    require_filled(find_shade(picture, shade), with_cells, without, found.mask)
    require_one_filling(thick, found.mask, found.width_px)
    return found


def _area_reading(picture: Image, ink: Mask, areas: Mask, level: int | None, walls: str) -> DrawingReading:
    plans = find_plans(areas)
    if not plans:
        raise GeometryError(_NOTHING)
    chosen, boxes = choose_plan(areas, plans, level)
    mask = largest_part(trim(chosen, 2 * ridge_half_width(chosen)))
    if not mask.any():
        raise GeometryError(_NOTHING)
    if walls == "hatched":
        require_hatch_outlined(picture, ink, mask)
    width = 2 * ridge_half_width(mask)
    require_whole(areas, mask, width, ink)
    if level is None:
        require_alone(drop_small(drop_straight(_dark_lines(picture, False)), _LETTER_PX), mask)
    return DrawingReading(mask, walls, boxes, width)


def _read_lines(picture: Image, ink: _Ink, level: int | None) -> DrawingReading:
    """Read walls drawn as lines: all dark lines, and black ones only; a grey line is a wall or is none."""
    filled = ink.filled | ink.closed if ink.hatched else ink.filled
    dark = drop_measures(drop_tables(_dark_lines(picture, False)))
    black = _dark_lines(picture, True) & drop_ruled(dark)
    if black.sum() >= _SAME_LINES * dark.sum():
        return _first_reading(dark, filled, level)
    try:
        found = _first_reading(dark, filled, level)
    except GeometryError as doubt:
        try:
            return _first_reading(black, filled, level)
        except GeometryError as error:
            raise more_helpful(doubt, error) from None
    other: DrawingReading | None = None
    with suppress(GeometryError):
        other = _first_reading(black, filled, level)
    if other is not None:
        require_same(found.mask, other.mask)
    return found


def _first_reading(lines: Mask, filled: Mask, level: int | None) -> DrawingReading:
    """Return the first reading of lines without a doubt."""
    doubt: GeometryError | None = None
    for drawn in _readings(lines):
        drawn_walls, widths = DrawnWalls(drawn.mask), set()
        for reach_px in drawn.reaches_px:
            try:
                width = _width_px(drawn_walls.areas(reach_px))
                if round(width) not in widths:
                    widths.add(round(width))
                    found = _enclosed(drawn, drawn_walls, width, level)
                    require_no_filling(filled, found.mask)
                    return found
            except GeometryError as error:
                doubt = more_helpful(doubt, error)
    raise doubt or GeometryError("no lines")


def _readings(dark: Mask) -> Iterator[_Walls]:
    """Yield what may be the walls among dark lines, the simplest first."""
    lines = drop_small(drop_straight(dark), _LETTER_PX)
    yield _Walls(lines, lines, _REACHES_PX, _GAPS)
    ruled = drop_ruled(dark)
    lines = drop_small(ruled, _LETTER_PX)
    yield _Walls(keep_cycles(lines), lines, (_CLOSED_PX,), _CLOSED_GAPS)
    joined = bridge_gaps(lines, _WIDEST_GAP_PX)
    yield _Walls(joined, lines, _REACHES_PX[:2], _GAPS)
    without = drop_small(bridge_gaps(drop_centre_lines(joined), _WIDEST_GAP_PX), _LETTER_PX)
    yield _Walls(without, lines, _REACHES_PX[:2], _GAPS)
    joined = bridge_gaps(drop_letters(ruled, _LETTER_PX), _WIDEST_GAP_PX)
    for walls in (joined, bridge_gaps(drop_centre_lines(joined), _WIDEST_GAP_PX)):
        yield _Walls(keep_cycles(walls), lines, (_CLOSED_PX,), _CLOSED_GAPS)


def _width_px(areas: Mask) -> float:
    """Return the typical width, px, of the areas that walls enclose."""
    plans = find_plans(areas)
    width = 2 * ridge_half_width(part(areas, plans[0])) if plans else 0.0
    if width < _NARROWEST_PX:
        raise GeometryError(_NOTHING)
    return width


def _enclosed(drawn: _Walls, drawn_walls: DrawnWalls, width: float, level: int | None) -> DrawingReading:
    lines = drawn.lines
    narrow, wide = (drawn_walls.areas(max(2.0, share * width)) for share in drawn.gaps)
    plans = find_plans(wide)
    if not plans:
        raise GeometryError(
            "the drawn walls enclose nothing; --seed COL,ROW names a place inside, --gap PX closes gaps"
        )
    chosen, boxes = choose_plan(wide, plans, level)
    mask = largest_part(chosen)
    require_agreement(mask, largest_part(narrow & grown(mask, _BESIDE_PX)))
    require_explained(lines, mask, width, _GAPS[1] * width)
    require_outlined(lines, mask)
    require_on_walls(lines, mask, width)
    require_taken(lines, mask, width, _GAPS[1] * width)
    if level is None:
        require_alone(lines, mask)
        require_alone(lines, mask, _JOINED_PX)
    return DrawingReading(mask, "lines", boxes, 2 * ridge_half_width(mask))


def _dark_lines(picture: Image, only_black: bool) -> Mask:
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    colourless = picture.max(axis=2) - picture.min(axis=2) <= _CHROMA
    dark = (grey <= _DARK) & colourless
    if only_black:
        ridge = cv2.GaussianBlur(255 - grey, (0, 0), 1.0) >= _BLACK
        dark &= cv2.dilate(ridge.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return np.asarray(dark)


def _is_hatched(picture: Image, ink: Mask, areas: Mask) -> bool:
    """Return whether colourless parallel lines cover the largest of the areas everywhere."""
    plans = find_plans(areas)
    if not plans:
        return False
    area = part(areas, plans[0])
    inside = cv2.erode(area.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    hatch = (ink & (picture.max(axis=2) - picture.min(axis=2) <= _CHROMA)).astype(np.uint8)
    if not (inside & (hatch > 0)).any() or (hatch[inside] > 0).all():
        return False
    to_hatch = cv2.distanceTransform(1 - hatch, cv2.DIST_L2, 5)[inside]
    grey = cv2.GaussianBlur(hatch.astype(np.float32), (0, 0), 0.8)
    gradient = (cv2.Sobel(grey, cv2.CV_32F, 1, 0) + 1j * cv2.Sobel(grey, cv2.CV_32F, 0, 1))[inside]
    parallel = abs((gradient**2).sum()) / (np.abs(gradient) ** 2).sum()
    apart = float(np.percentile(to_hatch, 90))
    return bool(apart <= min(_HATCH_PX, _HATCH * ridge_half_width(area)) and parallel > _PARALLEL)
