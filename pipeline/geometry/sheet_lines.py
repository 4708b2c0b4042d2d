"""Find workings whose walls a drawing sheet shows as lines, with gaps, among other lines."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.geometry.sheet_fill import disc
from pipeline.types import Mask

_LONG = 0.35  # of the sheet's shorter side: a straight line this long is a frame or a grid
_PIECE_PX, _CONTINUES_PX = 4, 12
_DEEPEST = 12
_MARGIN, _MARGIN_PX = 0.12, 3.0  # a wall lies this near to the edge of the workings: share of their width, and px
_ARROW_PX, _MEASURE, _MEASURES = 8.0, 3.5, 16.0  # width of arrows; drift widths of one measure, and of all


def drop_straight(lines: Mask) -> Mask:
    """Remove level and upright lines that are longer than a third of the sheet: grids, frames, tables."""
    long = max(40, round(_LONG * min(lines.shape)))
    mask = lines.astype(np.uint8)
    straight = np.zeros_like(mask)
    for kernel in (np.ones((1, long), np.uint8), np.ones((long, 1), np.uint8)):
        straight |= cv2.morphologyEx(mask, cv2.MORPH_OPEN, kernel)
    return lines & (straight == 0)


def drop_small(lines: Mask, extent_px: float) -> Mask:
    """Remove pieces that fit into a box of a side, such as letters, dashes and hatching.

    A small straight piece stays if it continues larger ones at both of its ends: it belongs to a wall with gaps.
    """
    _, labels, stats, _ = cv2.connectedComponentsWithStats(lines.astype(np.uint8), connectivity=8)
    large = np.maximum(stats[:, 2], stats[:, 3]) >= extent_px
    large[0] = False
    walls = cv2.dilate(large[labels].astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    for k in np.flatnonzero(~large[1:]) + 1:
        left, top, width, height, _ = stats[k]
        if max(width, height) < _PIECE_PX:
            continue
        rows, cols = np.nonzero(labels[top : top + height, left : left + width] == k)
        large[k] = _continues(np.column_stack([cols + left, rows + top]).astype(float), walls)
    return np.asarray(large[labels])


def _continues(points: np.ndarray, walls: Mask) -> bool:
    """Return whether a straight piece of line (n, 2) px, made longer at both ends, meets walls there."""
    middle = points.mean(axis=0)
    size, axes = np.linalg.eigh(np.cov((points - middle).T))
    along = (points - middle) @ axes[:, 1]
    if size[1] < 4 * size[0]:
        return False
    beyond = np.arange(1.0, _CONTINUES_PX + 1)
    for reach in (along.max() + beyond, along.min() - beyond):
        at = np.round(middle + reach[:, None] * axes[:, 1]).astype(int)
        at = at[(at >= 0).all(axis=1) & (at[:, 0] < walls.shape[1]) & (at[:, 1] < walls.shape[0])]
        if not walls[at[:, 1], at[:, 0]].any():
            return False
    return True


def enclose(lines: Mask, reach_px: float) -> Mask:
    """Return the areas that an odd number of walls separates from the sheet's edge.

    Gaps in walls narrower than twice `reach_px` count as closed. The pixels of lines and gaps go to the nearest area,
    so a wall is the middle of its line.
    """
    barrier = cv2.dilate(np.pad(lines.astype(np.uint8), 2), disc(reach_px))
    seeds = 1 - barrier
    seeds[[0, -1], :] = seeds[:, [0, -1]] = 1
    count, regions, stats, _ = cv2.connectedComponentsWithStats(seeds, connectivity=4)
    outside = int(regions[0, 0])
    across = disc(2 * reach_px + 5)
    depth = np.full(count, -1)
    depth[0], depth[outside] = -2, 0
    layer = np.array([outside])
    for level in range(1, _DEEPEST):
        near = cv2.dilate(np.isin(regions, layer).astype(np.uint8), across) > 0
        found = np.unique(regions[near])
        layer = found[depth[found] == -1]
        if not len(layer):
            break
        depth[layer] = level
    _, nearest = cv2.distanceTransformWithLabels(1 - seeds, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    region_of_label = np.zeros(int(nearest.max()) + 1, np.int32)
    region_of_label[nearest[seeds > 0]] = regions[seeds > 0]
    return np.asarray((depth[region_of_label[nearest]] % 2 == 1)[2:-2, 2:-2])


def unexplained_px(walls: Mask, mask: Mask, width_px: float, reach_px: float) -> float:
    """Return the length, px, of lines that hang together with the walls of workings and are no wall of theirs.

    Lines within `reach_px` of each other hang together. Straight pieces up to two and a half drift widths are
    measures and leaders, unless there are many.
    """
    to_edge = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)
    to_edge += cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5)
    margin = _MARGIN * width_px + _MARGIN_PX
    _, groups = cv2.connectedComponents(cv2.dilate(walls.astype(np.uint8), disc(reach_px)), connectivity=4)
    touching = np.unique(groups[walls & (to_edge <= margin)])
    left = walls & (to_edge > margin) & np.isin(groups, touching[touching > 0])
    _, labels, stats, _ = cv2.connectedComponentsWithStats(left.astype(np.uint8), connectivity=8)
    total = straight = 0.0
    for k, (col, row, cols, rows, _) in enumerate(stats[1:], start=1):
        piece = np.column_stack(np.nonzero(labels[row : row + rows, col : col + cols] == k)).astype(float)
        length = float(np.hypot(rows, cols))
        if length < 0.5 * width_px:
            continue
        across = np.ptp(piece @ np.linalg.eigh(np.cov(piece.T))[1][:, 0]) if len(piece) > 2 else 0.0
        if across <= _ARROW_PX and length <= _MEASURE * width_px:
            straight += length
        else:
            total += max(length, len(piece) / 3)
    return total + max(0.0, straight - _MEASURES * width_px)
