"""Cast rays against triangles, also in level fans as a planar scanner does."""

from __future__ import annotations

import numpy as np
from shapely import Polygon

from minexplore.sensing.planes import face_planes, plane_distances
from pipeline.errors import GeometryError
from pipeline.geometry.ray_scene import ray_scene


class RayCaster:
    """Casts rays against triangles (n, 3, 3) m; faces are found in 32 bits about their mean, distances in 64."""

    def __init__(self, triangles: np.ndarray) -> None:
        """Index the triangles.

        Raises
        ------
        GeometryError
            If there are no triangles.
        """
        if not len(triangles):
            raise GeometryError("rays: there are no triangles to cast rays against")
        self._middle = triangles.reshape(-1, 3).mean(axis=0)
        self._triangles = triangles
        about_middle = np.empty(triangles.shape, np.float32)
        np.subtract(triangles, self._middle, out=about_middle, casting="same_kind")
        self._scene = ray_scene(about_middle.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))

    def cast(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return distances (n,) m along unit directions (n, 3) from origins (n, 3) m; inf where a ray hits nothing."""
        rays = np.empty((len(origins), 6), np.float32)
        rays[:, :3], rays[:, 3:] = origins - self._middle, directions
        hit = self._scene.cast_rays(rays)
        face = hit["primitive_ids"].numpy().astype(np.int32)  # -1 where nothing is hit
        planes = face_planes(self._triangles[face].reshape(-1, 3), np.arange(3 * len(face)).reshape(-1, 3))
        return plane_distances(planes, np.arange(len(face)), origins, directions, hit["t_hit"].numpy())

    def fan(self, places: np.ndarray, bearings: np.ndarray, height_m: float | np.ndarray) -> np.ndarray:
        """Return ranges (n, k) m of level rays at bearings (n, k) rad from places (n, 2) m at one height, or (n,)."""
        count = bearings.shape[1]
        origins = np.column_stack([places, np.broadcast_to(height_m, len(places))]).repeat(count, axis=0)
        level = np.stack([np.cos(bearings), np.sin(bearings), np.zeros_like(bearings)], axis=-1).reshape(-1, 3)
        return self.cast(origins, level).reshape(-1, count)


def upright_walls(free: Polygon, height_m: float) -> np.ndarray:
    """Return the walls of a free-space polygon as triangles (n, 3, 3) m, from the floor to a height."""
    walls = []
    for ring in (free.exterior, *free.interiors):
        xy = np.asarray(ring.coords)[:, :2]
        low = np.column_stack([xy, np.zeros(len(xy))])
        high = low + np.array([0.0, 0.0, height_m])
        walls += [np.stack([low[:-1], low[1:], high[1:]], axis=1), np.stack([low[:-1], high[1:], high[:-1]], axis=1)]
    return np.concatenate(walls)
