"""The cubes in view from the air of a mine: beams cast all round, seen from above, through heights that are joined."""

from __future__ import annotations

import numpy as np

from baselines.oracle.span_views import FreeHeights, free_heights, samples_of
from baselines.oracle.visibility import _MARCH_M, _RAYS, _SAMPLE_M
from minexplore.sensing.cubes import CubeGrid
from minexplore.volume.air import AirSpans

_AT_ONCE = 32  # places from which beams are cast together
_ANGLE = np.linspace(0, 2 * np.pi, _RAYS, endpoint=False)
_AHEAD = np.stack([np.cos(_ANGLE), np.sin(_ANGLE)], axis=-1)


def cubes_in_view(
    free: AirSpans, range_m: float, grid: CubeGrid, numbers: np.ndarray, regions: np.ndarray
) -> list[np.ndarray]:
    """Return the cubes that beams from anywhere in each region may cross.

    Seen from above a beam is a straight line, no longer than its range, from column to column of the free space. Each
    has a height in common with the one before it: the beam is there at the border. A robot may be at any height of its
    column, and a beam may rise as it will, so a cube counts where such a line passes a height of it. Free space is
    widened by the visible rock and by what changes within a column, see `free_heights`.

    Parameters
    ----------
    free : AirSpans
        All free space.
    range_m : float
        Of beams.
    grid : CubeGrid
    numbers : (n,) int
        Of spans of the free space.
    regions : (n,) int
        Numbers of regions from 1; 0 where no robot comes.

    Returns
    -------
    list of (k,) int
        Cubes by region; the first entry, of no region, is empty.
    """
    heights, steps_m = free_heights(free), np.arange(0.0, range_m + _SAMPLE_M / np.sqrt(2) + _MARCH_M, _MARCH_M)
    picked = samples_of(free.within(numbers), np.arange(len(numbers)), regions, max(1, round(_SAMPLE_M / free.cell_m)))
    places, of = numbers[picked], regions[picked]
    seen = np.zeros((int(regions.max()) + 1, grid.total), bool)
    for region in range(1, len(seen)):
        own = places[of == region]
        for first in range(0, len(own), _AT_ONCE):
            passed = _passed(free.within(own[first : first + _AT_ONCE]), heights, steps_m)
            seen[region] |= grid.between(*passed)
    return [np.flatnonzero(cubes) for cubes in seen]


def _passed(eyes: AirSpans, heights: FreeHeights, steps_m: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the places (n, 2) m that beams from some spans pass, and the lowest and highest heights there, m."""
    layers, rows, cols = heights.low_m.shape
    lows, highs = heights.low_m.reshape(layers, -1), heights.high_m.reshape(layers, -1)
    places = np.repeat(eyes.places_m, _RAYS, axis=0)
    ahead = np.tile(_AHEAD, (len(eyes.row), 1))
    ray = np.arange(len(places))
    low, high = (np.repeat(end_m, _RAYS) for end_m in (eyes.floor_m, eyes.floor_m + eyes.headroom_m))
    found = []
    for step_m in steps_m:
        points = places[ray] + ahead[ray] * step_m
        at = np.floor((points - eyes.origin_m) / eyes.cell_m).astype(int)[:, ::-1] - heights.first
        inside = ((at >= 0) & (at < (rows, cols))).all(axis=1)
        column = np.where(inside, at[:, 0] * cols + at[:, 1], 0)
        meets = (lows[:, column] <= high) & (highs[:, column] >= low) & inside
        layer, number = np.nonzero(meets)
        reached = np.zeros((layers, len(places)), bool)  # two heights of one ray may meet one layer
        reached[layer, ray[number]] = True
        column_of = np.zeros(len(places), int)
        column_of[ray] = column
        layer, ray = np.nonzero(reached)
        low, high = lows[layer, column_of[ray]], highs[layer, column_of[ray]]
        found.append((places[ray] + ahead[ray] * step_m, low, high))
    points, low, high = (np.concatenate(column) for column in zip(*found, strict=True))
    return points, low, high
