"""Where the simplified mesh is farther from the collision walls than rock may be."""

from __future__ import annotations

import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely import Polygon

from pipeline.geometry.facets.level_slice import slice_points

_HEIGHTS_M = (0.3, 0.5, 1.0, 1.5)  # at which the certificate compares visible and collision walls
_MOST_M = 0.59  # from them; the certificate takes 0.6
_APART_M = 0.1


class WallDistance:
    """How far level slices of a mesh are from the walls of the workings, m.

    Displaced points are within their bounds, but the simplified faces between them leave out points that were nearer to
    the walls: from the foot of the floor chamfer to a point high over it, and across hollows.
    """

    def __init__(self, outline: Polygon, height_m: float) -> None:
        """Place points along the outline of workings of a height; slices are below the middle of it."""
        self._heights_m = [at for at in _HEIGHTS_M if at < height_m / 2]
        self._walls = cKDTree(shapely.get_coordinates(shapely.segmentize(outline.boundary, _APART_M)))

    def beyond(self, triangles: np.ndarray) -> np.ndarray:
        """Return the places (k, 3) m at which rock (m, 3, 3) m is too far from the outline, or leaves it bare."""
        places = [np.zeros((0, 3))]
        for height_m in self._heights_m:
            seen = slice_points(triangles, height_m)
            away = self._walls.query(seen, distance_upper_bound=_MOST_M, workers=2)[0]
            bare, nearest = cKDTree(seen).query(self._walls.data, workers=2)
            found = np.concatenate([seen[np.isinf(away)], seen[nearest[bare > _MOST_M]]])
            places.append(np.column_stack([found, np.full(len(found), height_m)]))
        return np.concatenate(places)
