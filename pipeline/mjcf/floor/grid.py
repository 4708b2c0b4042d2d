"""The grid that a visible floor is made on: points over floors, and what lies about them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from minesurveys.remarks import warn_user
from pipeline.geometry.rasterize import fill_polygon
from pipeline.params.fittings import FloorParams
from pipeline.types import DriftNetwork, Frame

STATION_M = 0.1  # between the points of a wall or a leg that distances are measured from
_BEYOND_M = 0.6  # under the rock, whose foot stands that far behind the wall
_MOST_POINTS = 16_000_000  # of the grid over the box; the embedded mine has 13 million
_MOST_ON_FLOOR = 2_000_000  # of them; 700 bytes each while the floor is simplified; the embedded mine has 1.2 million


@dataclass(frozen=True)
class FloorGrid:
    """Points of a square grid on floors, and what lies about them; places in m, mine frame.

    Attributes
    ----------
    spacing_m : float
    pixels : (n, 2) int
        Column and row of each point.
    points_m : (n, 3) float64
        On the floor, or in its plane behind a wall.
    rise : (n, 2) float64
        Slope of the floor there, m a metre to the east and to the north.
    faces : (f, 3) int32
        Triangles of points, against the clock from above.
    rim : (r, 2) int
        Edges of faces along which the mesh has to end; none where it ends behind walls.
    is_inside : (n,) bool
        Whether a point is before all walls.
    shore_m : (n,) float64
        Distance within a level floor to its end: infinite where all is level, below 0 on a slope.
    walls_m, ruts_m, brinks_m : (k, 3) float64
        Points at the feet of walls, along the legs, and where a floor ends over a drop.
    """

    spacing_m: float
    pixels: np.ndarray
    points_m: np.ndarray
    rise: np.ndarray
    faces: np.ndarray
    rim: np.ndarray
    is_inside: np.ndarray
    shore_m: np.ndarray
    walls_m: np.ndarray
    ruts_m: np.ndarray
    brinks_m: np.ndarray

    def floors_m(self, places: np.ndarray) -> np.ndarray:
        """Return the height (m,) m of the floor at places (m, 3) m close above it."""
        if not self.points_m[:, 2].any():
            return np.zeros(len(places))
        _, near = cKDTree(self.points_m).query(places)
        away = places[:, :2] - self.points_m[near, :2]
        found: np.ndarray = self.points_m[near, 2] + (self.rise[near] * away).sum(axis=1)
        return found


def level_grid(params: FloorParams, free: Polygon, network: DriftNetwork) -> FloorGrid:
    """Return the grid over a plan at z = 0, and behind its walls under the rock's foot.

    Parameters
    ----------
    params : FloorParams
    free : shapely.Polygon, m
    network : DriftNetwork
        Ruts follow its legs.
    """
    # An outline of stage 2 carries the grid that it was rounded to, and would round the band round it to that.
    free = shapely.set_precision(free, 0.0)
    west, south, east, north = free.bounds
    box_m2 = (east - west + 2 * _BEYOND_M) * (north - south + 2 * _BEYOND_M)
    params = widened(params, box_m2, free.buffer(_BEYOND_M).area)
    frame = _frame(free, params.spacing_m)
    pixels, cells = _grid(free.buffer(_BEYOND_M), frame)
    places = frame.to_mine(pixels + 0.5)
    lines = [shapely.LineString(leg.stations_m) for leg in network.legs if len(set(leg.stations_m)) > 1]
    level, none = np.zeros(len(places)), np.zeros((0, 3))
    return FloorGrid(
        params.spacing_m,
        pixels,
        np.column_stack([places, level]),
        np.zeros((len(places), 2)),
        _faces(cells.astype(np.int32)),
        np.zeros((0, 2), np.int32),
        shapely.contains_xy(free, places[:, 0], places[:, 1]),
        np.full(len(places), np.inf),
        _points_along(shapely.get_parts(free.boundary)),
        _points_along(lines),
        none,
    )


def widened(params: FloorParams, box_m2: float, floor_m2: float) -> FloorParams:
    """Widen the spacing until a grid has at most so many points over a box and on floors; print it."""
    least_m = math.sqrt(max(box_m2 / _MOST_POINTS, floor_m2 / _MOST_ON_FLOOR))
    if least_m <= params.spacing_m:
        return params
    warn_user(f"points of the visible floor are {least_m:.2f} m apart instead of {params.spacing_m:g} m", of="realism")
    return params.model_copy(update={"spacing_m": least_m})


def _points_along(lines: Sequence[BaseGeometry]) -> np.ndarray:
    """Return points (k, 3) m, at z = 0, along lines."""
    points = np.concatenate([shapely.get_coordinates(shapely.segmentize(line, STATION_M)) for line in lines])
    return np.column_stack([points, np.zeros(len(points))])


def _frame(free: Polygon, spacing_m: float) -> Frame:
    """Return the grid of points, as pixels' centres, over the workings and the rock's foot."""
    west, south, east, north = free.buffer(_BEYOND_M).bounds
    cols, rows = (int(np.ceil(length / spacing_m)) + 1 for length in (east - west, north - south))
    return Frame(1 / spacing_m, -west / spacing_m, north / spacing_m, cols, rows)


def _grid(covered: BaseGeometry, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels (n, 2), column and row, on the floor, and the corners (k, 4) of the cells between them."""
    inside = fill_polygon(covered, frame)
    kept = inside[:-1, :-1] & inside[:-1, 1:] & inside[1:, 1:] & inside[1:, :-1]
    used = np.zeros_like(inside)
    first, last = slice(-1), slice(1, None)
    for rows, cols in ((first, first), (first, last), (last, first), (last, last)):
        used[rows, cols] |= kept
    row, col = np.nonzero(used)
    number = np.zeros(inside.shape, np.int32)
    number[row, col] = np.arange(len(row))
    r, c = np.nonzero(kept)
    cells = np.column_stack([number[r + 1, c], number[r + 1, c + 1], number[r, c + 1], number[r, c]])
    return np.column_stack([col, row]), cells  # from the south-west, against the clock


def _faces(cells: np.ndarray) -> np.ndarray:
    return np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
