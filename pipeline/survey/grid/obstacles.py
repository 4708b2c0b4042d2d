"""The walls and obstacles of an occupancy grid: thin ones become as thick as a world's rock must be, specks go."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from skimage.morphology import skeletonize

from pipeline.geometry.outline.binarize import disc
from pipeline.guard.reading_process import warn_user
from pipeline.types import Mask

_SPECK = 0.5  # of the least thickness: what is smaller is a speck of the scan
_NAMED_M2 = 0.1
_CORNER = np.sqrt(2.0) - 1.0  # of the radius of an opening: how far a right-angled corner lies outside of it


def drivable_places(path: Path, free: Mask, cell_m: float, narrowest_m: float, thinnest_m: float) -> Mask:
    """Return the free cells that a robot may reach, between walls that are thick enough.

    Parameters
    ----------
    path : Path
        Of the map; warnings name it.
    free : (rows, cols) bool
    cell_m : float
        Edge of a cell.
    narrowest_m : float
        Free places narrower than this are left out, such as rays of a scanner through windows.
    thinnest_m : float
        Least thickness of walls, and twice the size of specks that are left out.
    """
    clear = _without_specks(path, free, cell_m, thinnest_m)
    wide = open_mask(clear, narrowest_m / 2 / cell_m)
    lost_m2 = float((clear & ~wide).sum()) * cell_m**2
    if lost_m2 >= _NAMED_M2:
        warn_user(
            f"of free cells in corners and places narrower than {narrowest_m:g} m are left out",
            of=path.name,
            count=f"{lost_m2:.1f} m2",
            option="--narrowest",
            advice="--narrowest M",
        )
    return open_mask(_with_thick_walls(path, wide, cell_m, thinnest_m), narrowest_m / 2 / cell_m)


def _without_specks(path: Path, free: Mask, cell_m: float, thinnest_m: float) -> Mask:
    """Return the free cells with those of solid specks: less than half of `thinnest_m` along and across."""
    thin = _thin_walls(free, thinnest_m / 2 / cell_m)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(thin.astype(np.uint8), connectivity=8)
    is_speck = stats[:, 2:4].max(axis=1) * cell_m < _SPECK * thinnest_m
    is_speck[0] = False
    if is_speck.any():
        warn_user(
            f"specks below {_SPECK * thinnest_m:g} m are left out",
            of=path.name,
            count=is_speck.sum(),
            option="--thinnest",
            advice="--thinnest M",
        )
    return np.asarray(free | is_speck[labels]) if count > 1 else free


def _with_thick_walls(path: Path, free: Mask, cell_m: float, thinnest_m: float) -> Mask:
    """Return the free cells beside walls that are as thick as a world's rock must be.

    A wall in a map is often a line of cells. A world has rough rock on both sides of it.
    """
    radius_px = thinnest_m / 2 / cell_m
    thin = _thin_walls(free, radius_px)
    if not thin.any():
        return free
    result = free & ~(cv2.dilate(skeletonize(thin).astype(np.uint8), disc(radius_px)) > 0)
    grown_m2 = float((free & ~result).sum()) * cell_m**2
    if grown_m2 >= _NAMED_M2:
        warn_user(
            f"walls thinner than {thinnest_m:g} m are made so thick, which takes {grown_m2:.1f} m2",
            of=path.name,
            option="--thinnest",
            advice="--thinnest M",
        )
    return np.asarray(result)


def _thin_walls(free: Mask, radius_px: float) -> Mask:
    """Return the solid cells that no disc in the solid covers, but for right-angled corners of what it covers."""
    if radius_px < 1.0:  # cells as large as the least thickness
        return np.zeros_like(free)
    core = open_mask(~free, radius_px).astype(np.uint8)
    return np.asarray(~free & (cv2.dilate(core, disc(_CORNER * radius_px + 0.5)) == 0))


def open_mask(mask: Mask, radius_px: float) -> Mask:
    """Return the cells that a disc covers which fits into a mask; it may reach over the edges of the grid."""
    pad = int(np.ceil(radius_px)) + 1
    padded = np.pad(mask.astype(np.uint8), pad, mode="edge")
    return np.asarray(cv2.morphologyEx(padded, cv2.MORPH_OPEN, disc(radius_px))[pad:-pad, pad:-pad] > 0)
