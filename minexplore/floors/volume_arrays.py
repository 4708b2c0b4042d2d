"""The arrays of a world that is one closed volume of free space: its facets, parts of rock, and floors by columns."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

WAYS = ((1, 0), (0, 1), (1, 1), (-1, 1))  # columns and rows from a span to the neighbours that `FloorSpans.way_m` is of


class FacetLabel(IntEnum):
    """What a facet of the free space, or the part of rock behind it, is."""

    FLOOR = 0  # flat enough to drive on
    WALL = 1
    ROOF = 2


def each_of(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return for so many (n,) things of each owner, one owner after the other, the owner and 0, 1, ... of the thing."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)


@dataclass(frozen=True)
class VolumeFacets:
    """The boundary of the free space: a closed triangle mesh.

    Attributes
    ----------
    vertices : (n, 3) float64, m, mine frame
    faces : (f, 3) int32
        Normals point out of the free space.
    label : (f,) int32
        See `FacetLabel`.
    leg : (f,) int32
        Number of the survey's leg.
    """

    vertices: np.ndarray
    faces: np.ndarray
    label: np.ndarray
    leg: np.ndarray

    @functools.cached_property
    def normals(self) -> np.ndarray:
        """Return twice the area times the normal (f, 3) out of the free space, m2."""
        a, b, c = np.moveaxis(self.vertices[self.faces], 1, 0)
        return np.cross(b - a, c - a)


@dataclass(frozen=True)
class Parts:
    """Convex parts of rock: part k has the corners from `first[k]` up to `first[k + 1]`.

    Attributes
    ----------
    corners : (c, 3) float64, m, mine frame
    first : (p + 1,) int32
    label : (p,) int32
        See `FacetLabel`, of the facet that the part is behind.
    """

    corners: np.ndarray
    first: np.ndarray
    label: np.ndarray

    def __len__(self) -> int:
        """Return how many parts there are."""
        return len(self.first) - 1

    def __getitem__(self, number: int) -> np.ndarray:
        """Return a part's corners (k, 3) m."""
        if not 0 <= number < len(self):
            raise IndexError(number)  # it ends a loop over the parts
        found: np.ndarray = self.corners[self.first[number] : self.first[number + 1]]
        return found

    @functools.cached_property
    def boxes_m(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the lowest and the highest corner (p, 3) m of the box about each part."""
        low, high = (function.reduceat(self.corners, self.first[:-1]) for function in (np.minimum, np.maximum))
        return low, high


@dataclass(frozen=True)
class FloorSpans:
    """Floors in columns of square cells: span k is over `origin_m` + (column, row) * cell to the next cell's corner.

    Attributes
    ----------
    column, row : (s,) int32
    floor_m, headroom_m : (s,) float64, m
        Height of the floor at the cell's middle, and free height over it.
    clearance_m : (s,) float64, m
        Level distance to rock at the height of a robot's chassis, at the roomiest place of the cell.
    storey : (s,) int32
        Number of the connected floor, the largest first, so that a column has a storey once; -1 where the floor is too
        steep, or the roof too low, for the robot that the world was made for.
    aside_m : (s, 3) float32, m
        The roomiest place of the cell's floor, from the floor at its middle.
    way_m : (s, 4) float32, m
        The least clearance on the widest way from there to the roomiest place of each neighbour, see `WAYS`; 0 where
        the floors do not meet.
    origin_m : (2,) float64, m, mine frame
    cell_m : float
    """

    column: np.ndarray
    row: np.ndarray
    floor_m: np.ndarray
    headroom_m: np.ndarray
    clearance_m: np.ndarray
    storey: np.ndarray
    aside_m: np.ndarray
    way_m: np.ndarray
    origin_m: np.ndarray
    cell_m: float

    @functools.cached_property
    def places_m(self) -> np.ndarray:
        """Return the middles (s, 3) m of the spans, on the floor."""
        middle = self.origin_m + (np.column_stack([self.column, self.row]) + 0.5) * self.cell_m
        return np.column_stack([middle, self.floor_m])

    @functools.cached_property
    def roomiest_m(self) -> np.ndarray:
        """Return the roomiest places (s, 3) m of the cells, on the floor."""
        found: np.ndarray = self.places_m + self.aside_m
        return found

    def heights_over(self, points_m: np.ndarray) -> np.ndarray:
        """Return how high points (n, 3) m are over the first floor below them in their cell and those around it.

        Infinite where no floor is below.
        """
        at = np.floor((points_m[:, :2] - self.origin_m) / self.cell_m).astype(np.int64) + 1
        cell, floor_m, columns = self._by_cell
        found = np.full(len(points_m), np.inf)
        for aside in (-1, 0, 1):
            for ahead in (-1, 0, 1):
                column, row = at[:, 0] + aside, at[:, 1] + ahead
                of_point = np.where((column >= 0) & (column < columns), row * columns + column, -1)
                under = _last_under(cell, floor_m, of_point, points_m[:, 2])
                height = np.where(under < 0, np.inf, points_m[:, 2] - floor_m[under])
                found = np.minimum(found, height)
        return found

    @functools.cached_property
    def _by_cell(self) -> tuple[np.ndarray, np.ndarray, int]:
        """Return the cells (s,) of floors, their heights (s,) m, by cell and height, and the number of columns."""
        columns = int(self.column.max(initial=0)) + 3
        cell = (self.row.astype(np.int64) + 1) * columns + self.column + 1
        order = np.lexsort((self.floor_m, cell))
        return cell[order], self.floor_m[order], columns

    @functools.cached_property
    def plan(self) -> np.ndarray:
        """Return the largest clearance (rows, columns) m in each column, 0 where there is no floor."""
        widest = np.zeros((int(self.row.max()) + 1, int(self.column.max()) + 1), np.float32)
        np.maximum.at(widest, (self.row, self.column), self.clearance_m.astype(np.float32))
        return widest


def _last_under(cell: np.ndarray, floor_m: np.ndarray, of_point: np.ndarray, height_m: np.ndarray) -> np.ndarray:
    """Return the number (n,) of the highest floor of its cell at or under each point, -1 without one.

    Floors (s,) are sorted by cell, then by height.
    """
    low, high = np.searchsorted(cell, of_point), np.searchsorted(cell, of_point, side="right")
    first = low.copy()
    while (low < high).any():  # each point halves the floors of its cell
        middle = (low + high) // 2
        under = (low < high) & (floor_m[np.minimum(middle, len(floor_m) - 1)] <= height_m)
        low, high = np.where(under, middle + 1, low), np.where(under | (low >= high), high, middle)
    return np.where(low > first, low - 1, -1)


@dataclass(frozen=True)
class VolumeArrays:
    """All of a volume that a world's files hold."""

    facets: VolumeFacets
    parts: Parts
    spans: FloorSpans
