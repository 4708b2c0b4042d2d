"""Read a ROS occupancy grid as workings: its free cells, and a plan drawn of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import shapely
from shapely import MultiPolygon
from skimage.morphology import skeletonize

from minesurveys.errors import GeometryError, InputError
from minesurveys.grid.nav2 import read_nav2_map
from minesurveys.remarks import warn_user
from pipeline.geometry.outline.binarize import disc
from pipeline.geometry.outline.half_level import trace_half_level
from pipeline.params.survey import GridSurveyParams
from pipeline.survey.draw import MineReading, reading_of
from pipeline.survey.grid.free_space import FreeCells, choose_free_space
from pipeline.survey.grid.placement import GridPlacement
from pipeline.types import Frame, Mask

_CELLS_M = (0.002, 5.0)
_SPECK = 0.5  # of the least thickness: what is smaller is a speck of the scan
_NAMED_M2 = 0.1
_CORNER = np.sqrt(2.0) - 1.0  # of the radius of an opening: how far a right-angled corner lies outside of it


def read_grid(params: GridSurveyParams) -> MineReading:
    """Read a map as workings. No check is made that is about drawings: the map says itself what is free.

    The mine frame is the map's own frame, unless the map lies more than 10 km from its origin. The walls of a map with
    a yaw are turned by it.

    Raises
    ------
    InputError
        As for `read_free_space`, or if the free space is longer than a mine may be.
    """
    free = read_free_space(params)
    rows, cols = free.cells.shape
    try:
        outline = trace_half_level(free.cells[::-1].astype(np.float32), Frame(1.0, 0.0, float(rows), cols, rows))
    except GeometryError as error:
        raise InputError(f"{params.map}: {error}") from error
    workings = MultiPolygon([shapely.transform(outline, free.placement.to_mine)])
    files = [file.as_posix() for file in free.files]
    return reading_of(params.map, workings, params, free.placement.georeference, "resolution", files=files)


def read_free_space(params: GridSurveyParams) -> FreeCells:
    """Read the free cells of a map that are built.

    Raises
    ------
    InputError
        If the map cannot be read, is too large or holds no floor; of several areas that could be meant a `DoubtError`.
    """
    path = Path(params.map)
    grid = read_nav2_map(path)
    low, high = _CELLS_M
    if not low <= grid.cell_m <= high:
        raise InputError(f"{path}: resolution = {grid.cell_m:g} m a cell; the limits are {low:g} and {high:g} m")
    placement = GridPlacement(grid.cell_m, grid.yaw_rad, grid.origin_m)
    free = ~grid.occupied if params.unknown_is_free else grid.free
    if not free.any():
        raise InputError(f"{path}: no free cells; free_thresh and negate in the file say which are free")
    widths = params.narrowest_m, params.thinnest_m
    found = choose_free_space(path, drivable_places(path, free, grid.cell_m, *widths), placement, params.entrance_m)
    return replace(found, files=(path, grid.picture))


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
