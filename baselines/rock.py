"""Distances in plan from a robot's places to the rock that it collides with."""

from __future__ import annotations

import numpy as np
import shapely
from skimage.graph import MCP_Geometric

from minexplore.local_models import LocalModels
from minexplore.world import World

_OCTILE = 1.09  # a path over the grid's eight neighbours is at most this much longer than the shortest one


class Rock:
    """The outlines in plan of a world's collision parts, which stand upright in the mine frame."""

    def __init__(self, models: LocalModels, radius_m: float) -> None:
        """Take the parts, and the radius of the disc that drives among them."""
        self._world: World = models.world
        self._tree = shapely.STRtree([shapely.convex_hull(shapely.MultiPoint(p.outline)) for p in models.parts])
        self._slack_m = models.world.cell_m  # between a place and the centre of the map's cell that it lies in
        self._fits = models.world.clearance_m >= radius_m - self._slack_m

    def distances_m(self, places_m: np.ndarray) -> np.ndarray:
        """Return the distance (n,) m from places (n, 2) m to the nearest part; 0 inside one."""
        points = shapely.points(places_m)
        return self._tree.query_nearest(points, return_distance=True, all_matches=False)[1]

    def outside(self, places_m: np.ndarray) -> np.ndarray:
        """Return which places (n, 2) m lie beyond the world's map."""
        at = self._cells(places_m)
        beyond = (at < 0) | (at >= self._fits.shape[::-1])
        return beyond[:, 0] | beyond[:, 1]

    def blocked(self, starts_m: np.ndarray, ends_m: np.ndarray) -> np.ndarray:
        """Return which straight ways from (n, 2) to (n, 2) m pass through rock."""
        lines = shapely.linestrings(np.stack([starts_m, ends_m], axis=1))
        found = np.zeros(len(lines), dtype=bool)
        found[self._tree.query(lines, predicate="intersects")[0]] = True
        return found

    def detour_m(self, start_m: np.ndarray, end_m: np.ndarray, longest_m: float) -> float:
        """Return a lower bound, m, on the way round rock between two places; inf where none is about `longest_m`."""
        cell = self._world.cell_m
        margin = int(np.ceil(longest_m / cell)) + 1
        start, end = self._cells(np.stack([start_m, end_m]))[:, ::-1]
        low = np.maximum(np.minimum(start, end) - margin, 0)
        high = np.maximum(start, end) + margin + 1
        fits = self._fits[low[0] : high[0], low[1] : high[1]].copy()
        fits[tuple(start - low)] = fits[tuple(end - low)] = True
        tree = MCP_Geometric(np.where(fits, 1.0, -1.0), fully_connected=True)
        length = tree.find_costs([tuple(start - low)], [tuple(end - low)])[0][tuple(end - low)] * cell
        return max(0.0, float(length) / _OCTILE - 2 * self._slack_m)

    def _cells(self, places_m: np.ndarray) -> np.ndarray:
        """Return the columns and rows (n, 2) of the map's cells that places (n, 2) m lie in."""
        return np.floor((places_m - self._world.origin_m) / self._world.cell_m).astype(int)
