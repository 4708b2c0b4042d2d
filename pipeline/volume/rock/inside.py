"""Which places are in the free space."""

from __future__ import annotations

import numpy as np

from pipeline.geometry.ray_scene import ray_scene
from pipeline.volume.union import Volume


class Inside:
    """Which places are in the free space, and how far they are from rock."""

    def __init__(self, volume: Volume) -> None:
        """Index the facets."""
        self._scene = ray_scene(volume.vertices, volume.faces, 1)
        self._corners = volume.vertices[volume.faces]

    def distance_m(self, places: np.ndarray) -> np.ndarray:
        """Return the distance (n,) m from rock, negative in rock; of five parities of rays the most frequent counts."""
        answer = self._scene.compute_signed_distance(places.astype(np.float32), nthreads=1, nsamples=5)
        found: np.ndarray = -answer.numpy()
        return found

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
        found[found] = ~self._are_enclosed(places[found])
        return found

    def are_free(self, places: np.ndarray) -> np.ndarray:
        """Return which places (n, 3) m are in the free space; the solid angle decides where rays say so."""
        found: np.ndarray = self.distance_m(places) > 0
        found[found] = self._are_enclosed(places[found])
        return found

    def _are_enclosed(self, places: np.ndarray) -> np.ndarray:
        """Return for which places (n, 3) m the solid angle of all facets is 4 pi; it is 0 in rock.

        The formula is that of van Oosterom and Strackee (1983).
        """
        found = np.zeros(len(places), bool)
        for k, place in enumerate(places):
            a, b, c = np.moveaxis(self._corners - place, 1, 0)
            x, y, z = (np.linalg.norm(one, axis=1) for one in (a, b, c))
            over = np.einsum("ij,ij->i", a, np.cross(b, c))
            under = x * y * z + (a * b).sum(axis=1) * z + (b * c).sum(axis=1) * x + (c * a).sum(axis=1) * y
            found[k] = 2 * np.arctan2(over, under).sum() > 2 * np.pi
        return found
