"""Where the cells of an occupancy grid lie in the mine frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from minesurveys.frames import Georeference
from minesurveys.vector.shapes import REACH_M
from pipeline.types import Points2

_STEP_M = 10.0  # the origin of far coordinates is moved to a multiple of this


@dataclass(frozen=True)
class GridPlacement:
    """The map from cells (col, row; row 0 in the south) to the mine frame, m.

    `corner_m` is the south-west corner of cell [0, 0] in the map's frame, `yaw_rad` the rotation about it. The mine
    frame is the map's frame, moved by `offset_m` if the map lies more than 10 km from its origin.
    """

    cell_m: float
    yaw_rad: float
    corner_m: tuple[float, float]

    @property
    def offset_m(self) -> tuple[float, float]:
        """Return the mine frame's origin in the map's frame, m."""
        east, north = self.corner_m
        if max(abs(east), abs(north)) <= REACH_M:
            return 0.0, 0.0
        return math.floor(east / _STEP_M) * _STEP_M, math.floor(north / _STEP_M) * _STEP_M

    @property
    def georeference(self) -> Georeference:
        """Return the map from the map's frame to the mine frame."""
        return Georeference("m", 1.0, self.offset_m, turned_deg=math.degrees(self.yaw_rad))

    def to_mine(self, cells: np.ndarray) -> Points2:
        """Map (n, 2) places (col, row) of the grid to metres in the mine frame."""
        corner = np.subtract(self.corner_m, self.offset_m)
        return np.asarray(cells * self.cell_m @ self._turn.T + corner)

    def to_cells(self, places_m: np.ndarray) -> Points2:
        """Map (n, 2) places, m, mine frame, to (col, row) of the grid."""
        corner = np.subtract(self.corner_m, self.offset_m)
        return np.asarray((places_m - corner) @ self._turn / self.cell_m)

    def cell_of_map(self, place_m: tuple[float, float]) -> tuple[int, int]:
        """Return the cell (col, row) of a place in the map's frame, m; it may lie outside the grid."""
        col, row = self.to_cells(np.array([place_m]) - self.offset_m)[0]
        return math.floor(col), math.floor(row)

    @property
    def _turn(self) -> np.ndarray:
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return np.array([[cos, -sin], [sin, cos]])
