"""Which places are in the free space."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from pipeline.geometry.facets.solid_angle import SolidAngle
from pipeline.geometry.nearest_facets import NearestFacets
from pipeline.geometry.ray_scene import ray_scene


class Inside:
    """Which places are in the free space, and how far they are from rock."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        """Take the facets (f, 3) of a closed mesh of vertices (v, 3) m."""
        self.mesh = vertices, faces

    @cached_property
    def _scene(self) -> Any:
        """Index the facets as rays meet them."""
        return ray_scene(*self.mesh, 1)

    @cached_property
    def _angle(self) -> SolidAngle:
        """Part the facets into blocks: most questions need none."""
        return SolidAngle(*self.mesh)

    @cached_property
    def _facets(self) -> NearestFacets:
        """Index the facets by distance."""
        return NearestFacets(*self.mesh, threads=1)

    def rays_say_free(self, places: np.ndarray) -> np.ndarray:
        """Return which places (n, 3) m are in the free space; of five parities of rays the most frequent counts."""
        found: np.ndarray = self._scene.compute_occupancy(places.astype(np.float32), nthreads=1, nsamples=5).numpy() > 0
        return found

    def distance_m(self, places: np.ndarray) -> np.ndarray:
        """Return the distance (n,) m from rock, negative in rock."""
        return self.nearest(places)[0]

    def nearest(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how far (n,) m the surface is, negative in rock, and its nearest facet (n,)."""
        found = self._facets.query(places)
        return np.where(self.rays_say_free(places), found.distance_m, -found.distance_m), found.facet

    def ways_m(self, places: np.ndarray, ways: np.ndarray) -> np.ndarray:
        """Return how far (...) the surface is from places (..., 3) m, in lengths of ways (..., 3); inf without one."""
        rays = np.concatenate([places, ways], axis=-1).astype(np.float32)
        found: np.ndarray = self._scene.cast_rays(rays, nthreads=1)["t_hit"].numpy().astype(np.float64)
        return found

    def are_farther(self, places: np.ndarray, than_m: float) -> np.ndarray:
        """Return which places (n, 3) m in the free space are farther from rock than a distance, m, of 0 or more.

        Rays are counted for places that far from a facet alone, as they take most of the time.
        """
        found: np.ndarray = self._facets.query(places).distance_m > than_m
        found[found] = self.rays_say_free(places[found])
        return found

    def are_in_rock(self, places: np.ndarray) -> np.ndarray:
        """Return which places (n, 3) m are in rock; the solid angle decides, as rays along facets miscount."""
        found = ~self.rays_say_free(places)
        found[found] = ~self._angle.are_enclosed(places[found])
        return found

    def are_free(self, places: np.ndarray) -> np.ndarray:
        """Return which places (n, 3) m are in the free space; the solid angle decides where rays say so."""
        found = self.rays_say_free(places)
        found[found] = self._angle.are_enclosed(places[found])
        return found
