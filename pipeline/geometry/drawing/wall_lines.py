"""Find workings whose walls a drawing shows as lines, with gaps, among other lines."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.types import Mask

_LONG = 0.6  # of the drawing's side: a straight line this long is a frame or a grid
_BREAK_PX = 25  # a light letter breaks a straight line by less
_INKED = 0.92  # of a straight line's length that has ink
_CROSSED = np.ones((5, 5), np.uint8)  # closes thin lines that were removed
_PIECE_PX, _CONTINUES_PX = 3, 13.0
_NARROW = 4.0  # variance along a narrow piece, of that across it
_CONE_RAD = np.radians(np.arange(-40, 41, 10))
_DEEPEST = 12
_MARGIN, _MARGIN_PX = 0.12, 3.0  # a wall lies this near to the edge of the workings: share of their width, and px
_RULED_PX = 0.7  # median distance of a ruled line's pixels from its axis; walls waver more
_LABEL_PX, _LABEL = 14, 2.0  # height of letters, and drift widths of the longest label
_MEASURE, _MEASURES = 5.0, 12.0  # drift widths of the longest measure, and of all


def find_straight(lines: Mask, share: float = _LONG) -> tuple[Mask, Mask]:
    """Return the level and the upright lines that are longer than a share of the drawing's side."""
    mask = lines.astype(np.uint8)
    tall, wide = (max(40, round(share * side)) for side in lines.shape)
    level, upright = (
        cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones(shape, np.uint8)) > 0 for shape in ((1, wide), (tall, 1))
    )
    return level, upright


def drop_straight(lines: Mask, share: float = _LONG) -> Mask:
    """Remove level and upright lines that are longer than a share of the drawing's side: grids, frames, tables."""
    level, upright = find_straight(lines, share)
    return lines & ~level & ~upright


def drop_ruled(lines: Mask) -> Mask:
    """Remove long straight lines as `drop_straight` does, also where a light letter breaks them."""
    mask = lines.astype(np.uint8)
    straight = np.zeros_like(mask)
    for axis, side in enumerate(lines.shape):
        shape, gap = np.ones(2, int), np.ones(2, int)
        shape[axis], gap[axis] = max(40, round(_LONG * side)), _BREAK_PX
        whole = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones(gap, np.uint8))
        covered = cv2.blur(mask.astype(np.float32), shape[::-1].tolist(), borderType=cv2.BORDER_CONSTANT)
        inked = cv2.dilate((covered >= _INKED).astype(np.uint8), np.ones(shape, np.uint8))
        straight |= inked & cv2.morphologyEx(whole, cv2.MORPH_OPEN, np.ones(shape, np.uint8))
    return keep_crossed(lines, lines & (straight == 0))


def keep_crossed(lines: Mask, rest: Mask) -> Mask:
    """Return what is left of lines, and what a line that was removed had crossed."""
    crossed = cv2.morphologyEx(np.pad(rest, 4).astype(np.uint8), cv2.MORPH_CLOSE, _CROSSED)[4:-4, 4:-4]
    return rest | (lines & (crossed > 0))


def drop_small(lines: Mask, extent_px: float) -> Mask:
    """Remove pieces that fit into a box of a side, such as letters, dashes and hatching.

    A small straight piece stays if it continues larger ones at both of its ends: it belongs to a wall with gaps.
    """
    _, labels, stats, _ = cv2.connectedComponentsWithStats(lines.astype(np.uint8), connectivity=8)
    large = np.maximum(stats[:, 2], stats[:, 3]) >= extent_px
    large[0] = False
    for _ in range(2):  # a piece may continue one that stayed
        walls = cv2.dilate(large[labels].astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        for k in np.flatnonzero(~large[1:]) + 1:
            left, top, width, height, _ = stats[k]
            if max(width, height) >= _PIECE_PX:
                rows, cols = np.nonzero(labels[top : top + height, left : left + width] == k)
                large[k] = _continues(np.column_stack([cols + left, rows + top]).astype(float), walls)
    return np.asarray(large[labels])


def drop_letters(lines: Mask, extent_px: float) -> Mask:
    """Remove pieces that fit into a box of a side, but for narrow ones: they may belong to a wall with gaps."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(lines.astype(np.uint8), connectivity=8)
    kept = np.maximum(stats[:, 2], stats[:, 3]) >= extent_px
    kept[0] = False
    for k in np.flatnonzero(~kept[1:]) + 1:
        left, top, width, height, _ = stats[k]
        if max(width, height) >= _PIECE_PX:
            points = np.argwhere(labels[top : top + height, left : left + width] == k).astype(float)
            size = np.linalg.eigvalsh(np.cov(points.T))
            kept[k] = size[1] >= _NARROW * size[0]
    return np.asarray(kept[labels])


def _continues(points: np.ndarray, walls: Mask) -> bool:
    """Return whether walls lie ahead of both ends of a narrow piece of line (n, 2) px."""
    middle = points.mean(axis=0)
    size, axes = np.linalg.eigh(np.cov((points - middle).T))
    if size[1] < 2 * size[0]:
        return False
    along = (points - middle) @ axes[:, 1]
    for end, axis in ((points[along.argmax()], axes[:, 1]), (points[along.argmin()], -axes[:, 1])):
        heading = np.arctan2(axis[1], axis[0]) + _CONE_RAD
        ahead = np.stack([np.cos(heading), np.sin(heading)], axis=-1)[:, None] * np.arange(2.0, _CONTINUES_PX)[:, None]
        at = np.round(end + ahead.reshape(-1, 2)).astype(int)
        at = at[(at >= 0).all(axis=1) & (at[:, 0] < walls.shape[1]) & (at[:, 1] < walls.shape[0])]
        if not walls[at[:, 1], at[:, 0]].any():
            return False
    return True


class DrawnWalls:
    """What walls, drawn as lines, enclose: several reaches share the distance of each pixel to the lines."""

    def __init__(self, lines: Mask) -> None:
        self._to_line = _distance_to(np.pad(lines, 2))
        self._stroke_px = stroke_px(lines)

    def areas(self, reach_px: float) -> Mask:
        """Return the areas that an odd number of walls separates from the drawing's edge.

        Gaps in walls narrower than twice `reach_px` count as closed. The pixels of lines and gaps go to the nearest
        area, so a wall is the middle of its line.
        """
        seeds = (self._to_line > reach_px).astype(np.uint8)
        seeds[[0, -1], :] = seeds[:, [0, -1]] = 1
        count, regions = cv2.connectedComponents(seeds, connectivity=4)
        depth = self._depths(regions, count, 2 * reach_px + self._stroke_px + 4)
        _, nearest = cv2.distanceTransformWithLabels(1 - seeds, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
        seed = np.flatnonzero(seeds)
        inside = np.zeros(int(nearest.max()) + 1, bool)
        inside[nearest.ravel()[seed]] = ((depth > 0) & (depth % 2 == 1))[regions.ravel()[seed]]
        return np.asarray(inside.take(nearest)[2:-2, 2:-2])

    @staticmethod
    def _depths(regions: np.ndarray, count: int, across_px: float) -> np.ndarray:
        """Return how many walls (count,) separate each region from the drawing's edge; -1 if it is not reached."""
        outside = int(regions[0, 0])
        depth = np.full(count, -1)
        depth[0], depth[outside] = -2, 0
        layer = np.array([outside])
        for level in range(1, _DEEPEST):
            if not (depth == -1).any():
                break
            chosen = np.zeros(count, bool)
            chosen[layer] = True
            found = np.zeros(count, bool)
            found[regions[grown(chosen.take(regions), across_px)]] = True
            layer = np.flatnonzero(found & (depth == -1))
            if not len(layer):
                break
            depth[layer] = level
        return depth


def stroke_px(lines: Mask) -> float:
    """Return the thickness of lines, px: four times the mean distance to paper over their pixels, less one."""
    if not lines.any():
        return 1.0
    distance = cv2.distanceTransform(lines.astype(np.uint8), cv2.DIST_L2, 5)
    return max(1.0, 4 * float(distance[lines].mean()) - 1)


def grown(mask: Mask, reach_px: float) -> Mask:
    """Return a mask with all pixels that are within a distance of it."""
    return np.asarray(_distance_to(mask) <= reach_px)


def _distance_to(mask: Mask) -> np.ndarray:
    """Return the distance of each pixel to a mask, px."""
    return np.asarray(cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5))


def margin_px(width_px: float) -> float:
    """Return how near to the edge of workings of a width a wall of theirs lies, px."""
    return _MARGIN * width_px + _MARGIN_PX


def unexplained_px(walls: Mask, mask: Mask, width_px: float, reach_px: float) -> float:
    """Return the length, px, of lines inside workings, or connected to their walls, that are no wall of theirs.

    Lines within `reach_px` of each other count as connected. Labels, and straight pieces up to five drift widths such
    as measures and leaders, do not count unless there are many.
    """
    to_edge = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)
    to_edge += cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5)
    margin = margin_px(width_px)
    _, groups = cv2.connectedComponents(grown(walls, reach_px).astype(np.uint8), connectivity=4)
    touching = np.unique(groups[walls & (to_edge <= margin)])
    left = walls & (to_edge > margin) & (mask | np.isin(groups, touching[touching > 0]))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(left.astype(np.uint8), connectivity=8)
    total = straight = 0.0
    for k, (col, row, cols, rows, _) in enumerate(stats[1:], start=1):
        piece = np.column_stack(np.nonzero(labels[row : row + rows, col : col + cols] == k)).astype(float)
        length = float(np.hypot(rows, cols))
        if length < 0.5 * width_px:
            continue
        is_label = min(rows, cols) <= _LABEL_PX and length <= _LABEL * width_px
        if is_label or (length <= _MEASURE * width_px and _is_ruled(piece)):
            straight += length
        else:
            total += max(length, len(piece) / 3)
    return total + max(0.0, straight - _MEASURES * width_px)


def _is_ruled(piece: np.ndarray) -> bool:
    if len(piece) < 3:
        return True
    across = (piece - piece.mean(axis=0)) @ np.linalg.eigh(np.cov(piece.T))[1][:, 0]
    return bool(np.median(np.abs(across - np.median(across))) <= _RULED_PX)
