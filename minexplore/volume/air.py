"""Where in the air of a volume a robot that flies can be, by columns of heights between which it has its middle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from minexplore.floors.volume_arrays import FloorSpans, each_of
from minexplore.volume.standing import connected, keys_of, neighbours

_LEAST_M = 0.01  # of heights that two columns have in common, for a robot to go from one to the other


@dataclass(frozen=True)
class AirSpans:
    """Heights over square cells: the robot's middle can be from `floor_m` to `floor_m` + `headroom_m`, mine frame.

    Attributes
    ----------
    column, row : (s,) int
    floor_m, headroom_m : (s,) float64, m
    origin_m : (2,) float64, m, mine frame
    cell_m : float
    """

    column: np.ndarray
    row: np.ndarray
    floor_m: np.ndarray
    headroom_m: np.ndarray
    origin_m: np.ndarray
    cell_m: float

    def within(self, those: np.ndarray) -> AirSpans:
        """Return some of the spans, by a mask or by numbers."""
        column, row, floor_m, headroom_m = (
            self.column[those],
            self.row[those],
            self.floor_m[those],
            self.headroom_m[those],
        )
        return AirSpans(column, row, floor_m, headroom_m, self.origin_m, self.cell_m)

    @property
    def places_m(self) -> np.ndarray:
        """Return the middles (s, 2) m of the cells."""
        return self.origin_m + (np.column_stack([self.column, self.row]) + 0.5) * self.cell_m

    def middles(self, step_m: float) -> np.ndarray:
        """Return points (n, 3) m in the spans: one in each layer of heights that is so thick."""
        first = np.floor(self.floor_m / step_m).astype(int)
        count = np.floor((self.floor_m + self.headroom_m) / step_m).astype(int) - first + 1
        span, layer = each_of(count)
        layer += first[span]
        height = np.clip((layer + 0.5) * step_m, self.floor_m[span], self.floor_m[span] + self.headroom_m[span])
        return np.column_stack([self.places_m[span], height])


def air_spans(spans: FloorSpans, radius_m: float, half_height_m: float) -> AirSpans:
    """Return where an upright cylinder has room: all columns within its radius are free over its height.

    A column of the cylinder is taken at the middle of its cell, as the volume's floors and roofs are.
    """
    floor, roof = spans.floor_m + half_height_m, spans.floor_m + spans.headroom_m - half_height_m
    keys = keys_of(spans.column, spans.row)
    order = np.argsort(keys, kind="stable")
    found, first, count = np.unique(keys[order], return_index=True, return_counts=True)
    own = np.flatnonzero(roof - floor > _LEAST_M)
    low, high = floor[own], roof[own]
    for east, north in _disc(radius_m / spans.cell_m):
        beside = keys_of(spans.column[own] + east, spans.row[own] + north)
        at = np.minimum(np.searchsorted(found, beside), len(found) - 1)
        count_at = np.where(found[at] == beside, count[at], 0)
        piece, number = each_of(count_at)
        other = order[first[at[piece]] + number]
        low, high, own = np.maximum(low[piece], floor[other]), np.minimum(high[piece], roof[other]), own[piece]
        roomy = high - low > _LEAST_M
        low, high, own = low[roomy], high[roomy], own[roomy]
    return AirSpans(spans.column[own], spans.row[own], low, high - low, spans.origin_m, spans.cell_m)


def _disc(radius: float) -> list[tuple[int, int]]:
    """Return the cells (column, row) whose middles are within a radius, in cells, of one's own; the farthest first."""
    reach = range(-int(radius), int(radius) + 1)
    cells = [(i, j) for i in reach for j in reach if 0 < i * i + j * j <= radius * radius]
    return sorted(cells, key=lambda cell: (-(cell[0] ** 2 + cell[1] ** 2), cell))


def reached_from(air: AirSpans, place_m: np.ndarray) -> AirSpans:
    """Return the spans that are connected to the one nearest to a place (3,) m.

    Raises
    ------
    ValueError
        If there is no span.
    """
    if not len(air.column):
        raise ValueError("no place where the robot fits")
    top_m = air.floor_m + air.headroom_m
    up = np.maximum(np.maximum(air.floor_m - place_m[2], place_m[2] - top_m), 0.0)
    seed = int((np.square(air.places_m - place_m[:2]).sum(axis=1) + up**2).argmin())
    return air.within(connected(neighbours(air, np.inf, 0.0, _LEAST_M), len(air.column), seed))
