"""A ROS occupancy grid as a plan: free cells are workings."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.survey.nav2 import read_nav2_map
from pipeline.survey.picture import turn_picture
from pipeline.survey.shapes import REACH_M
from pipeline.types import Frame, Georeference, Image

_INK, _PAPER = 40, 255


def draw_grid(path: Path, unknown_is_free: bool) -> tuple[Image, Frame, Georeference]:
    """Draw a map north up; return the plan, its frame in metres, and where the map's own origin went.

    The mine frame is the map's own, unless that counts from afar. A map that is turned about its origin is drawn
    turned back.

    Raises
    ------
    InputError
        If the map cannot be read or is too large.
    """
    found = read_nav2_map(path)
    free = ~found.occupied if unknown_is_free else found.free
    if not 0.002 <= found.cell_m <= 5.0:
        raise InputError(f"{path}: resolution = {found.cell_m:g} m a cell; want 0.002 to 5 m")
    plan = np.where(free[::-1, :, None], _INK, _PAPER).astype(np.uint8).repeat(3, axis=2)
    corner = np.array([0.0, plan.shape[0]])  # the map's origin: the south-west corner
    yaw_deg = math.degrees(found.yaw_rad)
    if abs(yaw_deg) > 1e-6:
        plan, turn = turn_picture(plan, yaw_deg)
        corner = turn @ [*corner, 1.0]
    per_m = 1.0 / found.cell_m
    step = 10.0 if max(map(abs, found.origin_m)) > REACH_M else 0.0  # map coordinates are counted from near the map
    away = tuple(math.floor(v / step) * step if step else 0.0 for v in found.origin_m)
    east, north = found.origin_m[0] - away[0], found.origin_m[1] - away[1]
    frame = Frame(
        per_m, float(corner[0] - east * per_m), float(corner[1] + north * per_m), plan.shape[1], plan.shape[0]
    )
    return plan, frame, Georeference("m", 1.0, (away[0], away[1]), turned_deg=yaw_deg)
