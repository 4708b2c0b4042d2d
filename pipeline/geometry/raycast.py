"""Rays against triangles: fans of level rays as a planar scanner casts them."""

from __future__ import annotations

from typing import Any

import numpy as np
import open3d
from shapely import Polygon

from pipeline.errors import GeometryError


class RayCaster:
    """Casts rays against triangles (n, 3, 3) m; 32 bits about their middle, so good to a tenth of a millimetre."""

    def __init__(self, corners: np.ndarray) -> None:
        """Take the triangles.

        Raises
        ------
        GeometryError
            If there are none.
        """
        if not len(corners):
            raise GeometryError("rays: no triangles to cast them against")
        tensor: Any = open3d.core.Tensor
        self._tensor = tensor
        self._middle = corners.reshape(-1, 3).mean(axis=0)
        self._scene = open3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(
            self._tensor((corners - self._middle).reshape(-1, 3).astype(np.float32)),
            self._tensor(np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3)),
        )

    def cast(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return distances (n,) m along unit rays (n, 3) from origins (n, 3); inf where nothing is hit."""
        rays = np.concatenate([origins - self._middle, directions], axis=1).astype(np.float32)
        return self._scene.cast_rays(self._tensor(rays))["t_hit"].numpy().astype(np.float64)

    def fan(self, places: np.ndarray, bearings: np.ndarray, height_m: float) -> np.ndarray:
        """Return ranges (n, k) m of level rays along bearings (n, k) rad from places (n, 2) m at one height."""
        count = bearings.shape[1]
        origins = np.column_stack([places, np.full(len(places), height_m)]).repeat(count, axis=0)
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
