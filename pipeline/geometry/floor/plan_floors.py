"""The floors of a plan with heights, as one volume takes them."""

from __future__ import annotations

from shapely.geometry.base import BaseGeometry

from pipeline.geometry.floor.mesh import build_floor
from pipeline.geometry.floor.network_heights import floor_lines
from pipeline.types import DriftNetwork, FloorMesh, Heights


def plan_floors(
    outline: BaseGeometry, heights: Heights, network: DriftNetwork, start_m: tuple[float, float] | None
) -> FloorMesh:
    """Return the floor of a plan's outline (m, mine frame), whose heights are known in its drifts.

    A grade begins at `start_m`, or where the main drift does.

    Raises
    ------
    GeometryError
        If a height is far from every drift, or contradicts another; the message names the place.
    """
    lines = floor_lines(heights, network, start_m or network.main_drift_m[0])
    return build_floor(outline, lines, heights.datum_m)
