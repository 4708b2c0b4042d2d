"""Elevations that stand for none: `--no-elevation Z`. Such points get heights from the rest of their line."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely.geometry.base import BaseGeometry

from minesurveys.errors import InputError
from minesurveys.remarks import warn_user
from minesurveys.vector.shapes import Shapes


def fill_elevations(path: Path, content: Shapes, none_at: float) -> Shapes:
    """Return shapes whose points without an elevation have one, linear along their lines; a warning counts them.

    Points without one have the elevation `none_at` or no number. A line without any takes the elevations of the
    nearest points of other lines, in plan. Shapes without elevations at all stay as they are if no shape has one.

    Parameters
    ----------
    path : Path
    content : Shapes
        In the file's coordinates, without collections.
    none_at : float
        In the file's unit.

    Raises
    ------
    InputError
        If no point has another elevation.
    """
    if not any(shape.has_z for shape in content.shapes):
        return content
    shapes = shapely.force_3d(np.array(content.shapes, object), none_at)
    points, ring = shapely.get_coordinates(_rings(shapes), include_z=True, return_index=True)
    points[points[:, 2] == none_at, 2] = np.nan
    missing = np.isnan(points[:, 2])
    if missing.all():
        raise InputError(f"{path}: --no-elevation {none_at:g}: no point has another elevation")
    if not missing.any():
        warn_user(f"--no-elevation {none_at:g}: no point has this elevation", of=path.name, option="--no-elevation")
        return content
    starts = np.flatnonzero(np.diff(ring, prepend=-1))
    for a, b in pairwise([*starts.tolist(), len(points)]):
        if missing[a:b].any() and not missing[a:b].all():
            points[a:b, 2] = _along(points[a:b])
    bare = np.isnan(points[:, 2])
    if bare.any():
        points[bare, 2] = points[~bare, 2][cKDTree(points[~bare, :2]).query(points[bare, :2])[1]]
    lines = len(np.unique(ring[bare]))
    others = f"; {lines} lines without any take those of the nearest lines" if lines else ""
    warn_user(
        f"points have no elevation, and take theirs from their own lines{others}",
        of=path.name,
        count=f"{missing.sum()} of {len(points)}",
    )
    return replace(content, shapes=list(shapely.set_coordinates(shapes, points)))


def _rings(shapes: np.ndarray) -> np.ndarray:
    """Return the rings, lines and points of shapes, in the order of their coordinates."""
    is_polygon = shapely.get_dimensions(shapes) == 2
    found: list[BaseGeometry] = []
    for shape, is_one in zip(shapes, is_polygon, strict=True):
        found += [shape.exterior, *shape.interiors] if is_one else [shape]
    return np.array(found, object)


def _along(line: np.ndarray) -> np.ndarray:
    """Return the elevations (k,) of a line (k, 3), linear between those that are known; a closed one has no ends."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1))])
    known = np.isfinite(line[:, 2])
    is_closed = len(line) > 2 and bool((line[0, :2] == line[-1, :2]).all()) and way[-1] > 0
    return np.asarray(np.interp(way, way[known], line[known, 2], period=way[-1] if is_closed else None))
