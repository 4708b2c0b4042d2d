"""The outline of fewest corners that keeps the drift network of a traced outline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from shapely import Polygon

from pipeline.errors import GeometryError
from pipeline.geometry.network.skeleton import require_same_network, trace_alike
from pipeline.geometry.outline.fewest_vertices import MOST_RATIO
from pipeline.geometry.outline.trace import simplify_outline, simplify_to_wall_error
from pipeline.geometry.wall_distance import largest_error_m
from pipeline.types import DriftNetwork

_HALVINGS = 3  # of a wall error that would change the drift network


@dataclass(frozen=True)
class NetworkGrid:
    """How a drift network is traced: cells, shortest leg and distance of stations, m."""

    cell_m: float
    min_leg_m: float
    spacing_m: float


@dataclass(frozen=True)
class SimplifiedOutline:
    """The simplified outline, its drift network, and the largest distance, m, by which a wall moved."""

    outline: Polygon
    network: DriftNetwork
    moved_m: float


def simplify_by_tolerance(traced: Polygon, tolerance_m: float, grid: NetworkGrid) -> SimplifiedOutline:
    """Simplify an outline by a tolerance.

    Raises
    ------
    GeometryError
        If the network would change; the message names `contours.tolerance_m`.
    """
    outline = simplify_outline(traced, tolerance_m)
    network = _same_network(traced, outline, grid, f"contours.tolerance_m = {tolerance_m:g}")
    return SimplifiedOutline(outline, network, tolerance_m)


def simplify_by_wall_error(traced: Polygon, wall_error_m: float, grid: NetworkGrid) -> SimplifiedOutline:
    """Simplify an outline to the fewest corners that keep a mean distance of the walls.

    A wall error that would change the network, or move a wall by more than eight times itself, is halved, up to three
    times.

    Raises
    ------
    GeometryError
        If the smallest of these is refused too; the message names `contours.wall_error_m` and the reason.
    """
    refused = GeometryError(f"contours.wall_error_m = {wall_error_m:g}: no outline was tried")
    for error_m in (wall_error_m / 2.0 ** np.arange(_HALVINGS + 1)).tolist():
        setting = f"contours.wall_error_m = {error_m:g}"
        try:
            outline = simplify_to_wall_error(traced, error_m)
            network = _same_network(traced, outline, grid, setting)
        except GeometryError as error:
            refused = error
            continue
        moved_m = float(np.ceil(1000 * largest_error_m(traced, outline)) / 1000)
        if moved_m <= MOST_RATIO * wall_error_m:
            return SimplifiedOutline(outline, network, moved_m)
        refused = GeometryError(f"{setting}: a wall would move by {moved_m:g} m")
    raise refused


def _same_network(traced: Polygon, outline: Polygon, grid: NetworkGrid, setting: str) -> DriftNetwork:
    """Return the network of the simplified outline; raise if it is not that of the traced outline."""
    before, network = trace_alike([traced, outline], grid.cell_m, grid.min_leg_m, grid.spacing_m)
    require_same_network(before, network, outline, setting, grid.min_leg_m)
    return network
