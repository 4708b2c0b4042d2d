"""The floors of a plan with heights, as one volume takes them."""

from __future__ import annotations

from shapely.geometry.base import BaseGeometry

from pipeline.geometry.floor.mesh import build_floor
from pipeline.geometry.floor.network_heights import floor_lines
from pipeline.types import NO_FLOORS, DriftNetwork, FloorMesh, Survey


def plan_floors(outline: BaseGeometry, survey: Survey, network: DriftNetwork) -> FloorMesh:
    """Return the floor of a plan's outline (m, mine frame), whose heights are known in its drifts.

    It has no faces if the plan has no heights.

    Raises
    ------
    GeometryError
        If a height is far from every drift, or contradicts another; the message names the place.
    """
    heights = survey.heights
    if heights is None:
        return NO_FLOORS
    lines = floor_lines(heights, network, survey.entrance_m or network.main_drift_m[0])
    return build_floor(outline, lines, heights.datum_m)
