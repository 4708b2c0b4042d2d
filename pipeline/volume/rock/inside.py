"""Which places are in the free space."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from pipeline.geometry.ray_scene import ray_scene
from pipeline.volume.rock.solid_angle import SolidAngle
from pipeline.volume.union import Volume


class Inside:
    """Which places are in the free space, and how far they are from rock."""

    def __init__(self, volume: Volume) -> None:
        """Index the facets."""
        self._scene = ray_scene(volume.vertices, volume.faces, 1)
        self.mesh = volume.vertices, volume.faces

    @cached_property
    def _angle(self) -> SolidAngle:
        """Part the facets into blocks: most questions need none."""
        return SolidAngle(*self.mesh)

    def distance_m(self, places: np.ndarray) -> np.ndarray:
        """Return the distance (n,) m from rock, negative in rock; of five parities of rays the most frequent counts."""
        answer = self._scene.compute_signed_distance(places.astype(np.float32), nthreads=1, nsamples=5)
        found: np.ndarray = -answer.numpy()
        return found

    def nearest(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how far (n,) m the surface is, negative in rock as in `distance_m`, and its nearest facet (n,)."""
        found = self._scene.compute_closest_points(places.astype(np.float32), nthreads=1)
        return self.distance_m(places), found["primitive_ids"].numpy().astype(np.int64)

    def are_farther(self, places: np.ndarray, than_m: float) -> np.ndarray:
        """Return which places (n, 3) m in the free space are farther from rock than a distance, m, of 0 or more.

        Rays are counted for places that far from a facet alone, as they take most of the time.
        """
        away = self._scene.compute_distance(places.astype(np.float32), nthreads=1).numpy()
        found: np.ndarray = away > than_m
        found[found] = self.distance_m(places[found]) > than_m
        return found

    def are_in_rock(self, places: np.ndarray) -> np.ndarray:
        """Return which places (n, 3) m are in rock; the solid angle decides, as rays along facets miscount."""
        found: np.ndarray = self.distance_m(places) < 0
        found[found] = ~self._angle.are_enclosed(places[found])
        return found

    def are_free(self, places: np.ndarray) -> np.ndarray:
        """Return which places (n, 3) m are in the free space; the solid angle decides where rays say so."""
        found: np.ndarray = self.distance_m(places) > 0
        found[found] = self._angle.are_enclosed(places[found])
        return found
