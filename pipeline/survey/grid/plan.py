"""Read a ROS occupancy grid as workings: its free cells, and a plan drawn of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from shapely import MultiPolygon

from pipeline.errors import GeometryError, InputError
from pipeline.geometry.outline.half_level import trace_half_level
from pipeline.params.survey import GridSurveyParams
from pipeline.survey.draw import draw_workings, frame_of
from pipeline.survey.grid.free_space import FreeCells, choose_free_space
from pipeline.survey.grid.nav2 import read_nav2_map
from pipeline.survey.grid.obstacles import drivable_places
from pipeline.survey.grid.placement import GridPlacement
from pipeline.types import Frame, Georeference, Image

_CELLS_M = (0.002, 5.0)


@dataclass(frozen=True)
class GridReading:
    """The workings of a map (m, mine frame), the plan drawn of them with its frame, and the georeference."""

    workings: MultiPolygon
    plan: Image
    frame: Frame
    georeference: Georeference


def read_grid(params: GridSurveyParams) -> GridReading:
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
    frame = frame_of(params.map, workings, params, "resolution")
    plan = draw_workings(workings, frame, params.labels_m, params.drawing_grey)
    return GridReading(workings, plan, frame, free.placement.georeference)


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
    return choose_free_space(path, drivable_places(path, free, grid.cell_m, *widths), placement, params.entrance_m)
