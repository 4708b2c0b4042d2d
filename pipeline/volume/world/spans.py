"""Spans of free space in vertical columns through the middles of a grid's cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from minexplore.floors.volume_arrays import each_of

_PLUMB = 1e-12  # m2, of a facet seen from above: its height is that of its corners
_LEAST_M = 1e-6  # of a span


@dataclass(frozen=True)
class Spans:
    """Where columns meet the free space, ordered by column, row and height.

    `facet` (s,) is the facet that the floor of the span belongs to.
    """

    column: np.ndarray
    row: np.ndarray
    floor_m: np.ndarray
    roof_m: np.ndarray
    facet: np.ndarray


def spans_of(vertices: np.ndarray, faces: np.ndarray, origin_m: np.ndarray, cell_m: float) -> Spans:
    """Return the spans of a closed mesh whose normals point out of the free space.

    The columns that an edge of two facets separates are those of its own ends and of nothing else, so that each column
    belongs to one of the two. The same edges decide whether a facet is floor or roof: the normal of one that stands
    nearly upright has a rounded sign, and a column would have more floors than roofs.

    Parameters
    ----------
    vertices : (n, 3) float64, m
    faces : (f, 3) int
    origin_m : (2,) float64, m
    cell_m : float
    """
    facet, column, row, is_floor = _columns(vertices, faces, origin_m, cell_m)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normal = np.cross(b - a, c - a)
    corner, n = a[facet], normal[facet]
    x, y = origin_m[0] + (column + 0.5) * cell_m, origin_m[1] + (row + 0.5) * cell_m
    up = np.where(np.abs(n[:, 2]) < _PLUMB, _PLUMB, n[:, 2])
    z = corner[:, 2] - (n[:, 0] * (x - corner[:, 0]) + n[:, 1] * (y - corner[:, 1])) / up
    heights = vertices[faces][:, :, 2]
    z = np.clip(z, heights.min(axis=1)[facet], heights.max(axis=1)[facet])
    order = np.lexsort((~is_floor, z, row, column))
    facet, column, row, z = facet[order], column[order], row[order], z[order]
    depth = np.cumsum(np.where(is_floor[order], 1, -1))
    before = np.concatenate([[0], depth[:-1]])
    begin, end = np.flatnonzero((before <= 0) & (depth > 0)), np.flatnonzero((before > 0) & (depth <= 0))
    tall = z[end] - z[begin] > _LEAST_M
    begin, end = begin[tall], end[tall]
    return Spans(column[begin], row[begin], z[begin], z[end], facet[begin])


def _columns(
    vertices: np.ndarray, faces: np.ndarray, origin_m: np.ndarray, cell_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return facet, column and row of each meeting of a facet and a column, and whether the facet is a floor there.

    Free space is over a facet whose western side goes north, as its corners go.
    """
    plan = (vertices[:, :2] - origin_m) / cell_m - 0.5
    first = np.ceil(plan[:, 1]).astype(np.int64)  # row from which a vertex counts
    sides: list[np.ndarray] = []
    for k in range(3):
        start, stop = faces[:, k], faces[:, (k + 1) % 3]
        low, high = np.sort(np.column_stack([start, stop]).astype(np.int64), axis=1).T
        begin, end = np.minimum(first[low], first[high]), np.maximum(first[low], first[high])
        facet, row = each_of(end - begin)
        row += begin[facet]
        a, b = plan[low[facet]], plan[high[facet]]
        x = a[:, 0] + (row - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
        north = first[start] < first[stop]
        sides.append(np.column_stack([facet, row, np.ceil(x).astype(np.int64), north[facet]]))
    each = np.concatenate(sides)
    each = each[np.lexsort((each[:, 2], each[:, 1], each[:, 0]))]
    left, right = each[0::2], each[1::2]  # a row cuts none or two sides of a facet
    owner, step = each_of(right[:, 2] - left[:, 2])
    return left[owner, 0], left[owner, 2] + step, left[owner, 1], left[owner, 3] == 1
