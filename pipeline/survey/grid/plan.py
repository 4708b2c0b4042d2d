"""Draw a ROS occupancy grid as a plan: free cells are workings."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.survey.drawing.picture import turn_picture
from pipeline.survey.grid.nav2 import read_nav2_map
from pipeline.survey.vector.shapes import REACH_M
from pipeline.types import Frame, Georeference, Image

_WORKINGS_GREY, _PAPER_GREY = 40, 255


def draw_grid(path: Path, unknown_is_free: bool) -> tuple[Image, Frame, Georeference]:
    """Draw a map north up. Return the plan, its frame in metres, and its georeference.

    The mine frame is the map's own frame, unless the map lies more than 10 km from its origin. A rotated map is drawn
    with its rotation removed.

    Raises
    ------
    InputError
        If the map cannot be read or is too large.
    """
    grid = read_nav2_map(path)
    free = ~grid.occupied if unknown_is_free else grid.free
    if not 0.002 <= grid.cell_m <= 5.0:
        raise InputError(f"{path}: resolution = {grid.cell_m:g} m a cell; the limits are 0.002 and 5 m")
    plan = np.where(free[::-1, :, None], _WORKINGS_GREY, _PAPER_GREY).astype(np.uint8).repeat(3, axis=2)
    corner = np.array([0.0, plan.shape[0]])  # the map's origin: the south-west corner
    yaw_deg = math.degrees(grid.yaw_rad)
    if abs(yaw_deg) > 1e-6:
        plan, turn = turn_picture(plan, yaw_deg)
        corner = turn @ [*corner, 1.0]
    per_m = 1.0 / grid.cell_m
    step = 10.0 if max(map(abs, grid.origin_m)) > REACH_M else 0.0  # move the origin of far coordinates to the map
    offset = tuple(math.floor(v / step) * step if step else 0.0 for v in grid.origin_m)
    east, north = grid.origin_m[0] - offset[0], grid.origin_m[1] - offset[1]
    frame = Frame(
        per_m, float(corner[0] - east * per_m), float(corner[1] + north * per_m), plan.shape[1], plan.shape[0]
    )
    return plan, frame, Georeference("m", 1.0, (offset[0], offset[1]), turned_deg=yaw_deg)
