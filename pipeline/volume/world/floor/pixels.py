"""Facets on a square grid in plan: the grid's points on them, and points found again by pixel and height."""

from __future__ import annotations

import numpy as np

from minexplore.floors.volume_arrays import each_of

_TOGETHER = (
    1 << 17
)  # pixels that are found at once: 20 arrays as long as those of a mine would be held beside each other


def pixels_on(corners_m: np.ndarray, start_m: np.ndarray, spacing_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of a grid that lie over or under facets in plan.

    A point on an edge that two facets share belongs to one of them.

    Parameters
    ----------
    corners_m : (f, 3, 2) float64
        Of each facet, in plan.
    start_m : (2,) float64
        The point of column and row 0. Columns go to the east, rows to the south.
    spacing_m : float

    Returns
    -------
    facet : (n,) int
        The facet of each point.
    pixels : (n, 2) int32
        Column and row.
    """
    ends = np.stack([corners_m, np.roll(corners_m, -1, axis=1)], axis=2).reshape(-1, 2, 2)
    south_first = ends[:, 0, 1] <= ends[:, 1, 1]
    south, north = (np.where(south_first[:, None], ends[:, k], ends[:, 1 - k]) for k in (0, 1))
    last, before = (np.floor((start_m[1] - end[:, 1]) / spacing_m).astype(np.int64) for end in (south, north))
    edge, along = each_of(last - before)
    row = before[edge] + 1 + along
    share = (start_m[1] - row * spacing_m - south[edge, 1]) / (north[edge, 1] - south[edge, 1])
    east = south[edge, 0] + share * (north[edge, 0] - south[edge, 0])
    order = np.lexsort((east, row, edge // 3))  # each facet has two crossings in each row that it reaches
    first, end = (np.ceil((east[order][k::2] - start_m[0]) / spacing_m).astype(np.int64) for k in (0, 1))
    span, aside = each_of(end - first)
    pixels = np.column_stack([(first[span] + aside).astype(np.int32), row[order][::2][span].astype(np.int32)])
    return (edge // 3)[order][::2][span], pixels


class PixelIndex:
    """Finds points by pixel and height: over one pixel there may be several floors."""

    def __init__(self, pixels: np.ndarray, height_m: np.ndarray) -> None:
        """Sort points with pixels (n, 2) from 0 and heights (n,) m."""
        self._low_m, self._columns = float(height_m.min()), int(pixels[:, 0].max()) + 3
        self._span_m = 3 * (float(height_m.max()) - self._low_m) + 1e3
        value = self._value(pixels, height_m)
        self._order = np.argsort(value, kind="stable").astype(np.int32)
        self._value_of, self._height_m = value[self._order], height_m[self._order]
        self._pixel_of = self._pixel(pixels)[self._order]

    def find(self, pixels: np.ndarray, height_m: np.ndarray, within_m: float) -> np.ndarray:
        """Return the point (m,) int32 of each pixel that is nearest in height, -1 where none is near enough."""
        found = np.empty(len(pixels), np.int32)
        for start in range(0, len(pixels), _TOGETHER):
            some = slice(start, start + _TOGETHER)
            found[some] = self._find(pixels[some], height_m[some], within_m)
        return found

    def _find(self, pixels: np.ndarray, height_m: np.ndarray, within_m: float) -> np.ndarray:
        at, pixel = np.searchsorted(self._value_of, self._value(pixels, height_m)), self._pixel(pixels)
        sides = [np.clip(at + aside, 0, len(self._order) - 1) for aside in (-1, 0)]
        apart = [
            np.where(self._pixel_of[side] == pixel, np.abs(self._height_m[side] - height_m), np.inf) for side in sides
        ]
        nearer = np.where(apart[0] <= apart[1], *sides)
        found: np.ndarray = np.where(np.minimum(*apart) <= within_m, self._order[nearer], -1)
        return found

    def _pixel(self, pixels: np.ndarray) -> np.ndarray:
        found: np.ndarray = (pixels[:, 1].astype(np.int64) + 1) * self._columns + pixels[:, 0] + 1
        return found

    def _value(self, pixels: np.ndarray, height_m: np.ndarray) -> np.ndarray:
        found: np.ndarray = self._pixel(pixels) * self._span_m + (height_m - self._low_m)
        return found
