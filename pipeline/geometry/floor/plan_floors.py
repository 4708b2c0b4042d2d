"""The floors of a plan with heights, as one volume takes them."""

from __future__ import annotations

import numpy as np
from shapely.geometry.base import BaseGeometry

from pipeline.geometry.floor.mesh import build_floor
from pipeline.geometry.floor.network_heights import floor_lines
from pipeline.types import DriftNetwork, FloorMesh, Heights

_ANY_DEG = 90.0  # a volume has floors of any steepness


def plan_floors(
    outline: BaseGeometry, heights: Heights, network: DriftNetwork, entrance_m: tuple[float, float]
) -> FloorMesh:
    """Return the floor of an outline (m, mine frame), whose heights are known in its drifts.

    Raises
    ------
    GeometryError
        If a height is far from every drift, or contradicts another; the message names the place.
    """
    floor = build_floor(outline, floor_lines(heights, network, entrance_m), _ANY_DEG)
    return FloorMesh(floor.vertices, floor.faces.astype(np.int32), heights.datum_m)
