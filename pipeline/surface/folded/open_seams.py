"""Where the rock of two sheets meets: no wall on their seam, one roof over it, and no gap between their points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from pipeline.surface.mesh.lattice import BLEND_M, WALL, CrossSection, Lattice
from pipeline.surface.mesh.seam_join import SeamJoin
from pipeline.surface.mesh.walls import SheetColumns, smoothstep

_FADE_M = 1.0  # from a seam, over which a difference of two sheets fades


def open_seams(lattice: Lattice, profile: CrossSection) -> Lattice:
    """Return a lattice of several sheets without walls on their seams; the roof goes on there, and points meet.

    The columns on a seam are taken for points of the roof. Positions and directions of two sheets on a seam are equal,
    as seen from either.
    """
    walls, sheets = lattice.walls, lattice.walls.sheets
    assert sheets is not None
    columns, top = len(walls.xy), (lattice.rows - 1) * len(walls.xy)
    is_open = np.flatnonzero(sheets.open)
    nearest = walls.closed[cKDTree(walls.xy[walls.closed]).query(walls.xy[is_open])[1]]
    vertices, direction, share = lattice.vertices.copy(), lattice.direction.copy(), lattice.roof_share.copy()
    column = lattice.column.copy()
    for row in range(lattice.rows):
        column[row * columns + is_open] = nearest
    vertices[top + is_open, 2] = _roof_heights(lattice, profile, is_open)
    share[top + is_open] = smoothstep(_away(walls.xy, walls.closed, is_open) / BLEND_M)
    turned = np.column_stack([walls.inward[nearest] * (1 - share[top + is_open])[:, None], -share[top + is_open]])
    direction[top + is_open] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    of_open = (lattice.piece == WALL) & np.isin(lattice.faces % columns, is_open).any(axis=1)
    offset = sheets.offset_m[column]
    meeting = _join(vertices, sheets, lattice.rows, columns)
    placed = vertices - np.column_stack([offset, np.zeros(len(offset))])
    met = meeting.meet(placed) + np.column_stack([offset, np.zeros(len(offset))])
    direction = meeting.meet(direction)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    for row in range(lattice.rows - 1):
        direction[row * columns + is_open] = [0.0, 0.0, -1.0]  # no face has these points
    return replace(
        lattice,
        vertices=met,
        direction=direction,
        roof_share=meeting.meet(share),
        column=column,
        faces=lattice.faces[~of_open],
        piece=lattice.piece[~of_open],
        seam_join=meeting,
    )


def _away(xy: np.ndarray, closed: np.ndarray, of: np.ndarray) -> np.ndarray:
    """Return the distances (k,) m of columns from the nearest column on a wall."""
    return np.asarray(cKDTree(xy[closed]).query(xy[of])[0])


def _roof_heights(lattice: Lattice, profile: CrossSection, columns: np.ndarray) -> np.ndarray:
    """Return the roof's height (k,) m over columns: that of the nearest inner point, with the arch between the two."""
    walls, inner = lattice.walls, lattice.vertices[lattice.wall_vertices :]
    _, beside = cKDTree(inner[:, :2]).query(walls.xy[columns])
    away = _away(walls.xy, walls.closed, columns)
    off = cKDTree(walls.xy[walls.closed]).query(inner[beside, :2])[0]
    one, two = (np.minimum(d / profile.arch_half_span_m, 1.0) for d in (away, off))
    rise = profile.arch_rise_m * (one * (2 - one) - two * (2 - two))
    lowest = profile.height_m - profile.arch_rise_m
    return np.clip(inner[beside, 2] + rise, lowest, profile.height_m)


def _join(vertices: np.ndarray, sheets: SheetColumns, rows: int, columns: int) -> SeamJoin:
    """Return where a lattice's points meet: the walls' columns at the ends of seams, and the roof over seams."""
    ends = ~sheets.open[sheets.joined]
    points, place, places = [], [], int(sheets.group.max()) + 1
    for row in range(rows):
        of_row = ends | (row == rows - 1)
        points.append(row * columns + sheets.joined[of_row])
        place.append(row * places + sheets.group[of_row])
    point, number = np.concatenate(points), np.unique(np.concatenate(place), return_inverse=True)[1]
    away, nearest = cKDTree(vertices[point]).query(vertices, distance_upper_bound=_FADE_M)
    near = np.flatnonzero(np.isfinite(away))
    return SeamJoin(point, number, near, nearest[near], 1 - smoothstep(away[near] / _FADE_M))
