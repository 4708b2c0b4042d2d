"""Lines at which a volume's floor turns: there it is farther from a plane than at samples between them."""

from __future__ import annotations

import numpy as np

from minexplore.floors.volume_arrays import VolumeFacets, each_of

_STEP_M = 0.05  # between places of a crease
_MOST = 5_000_000  # places of all creases; a larger mine has them farther apart
_LEAST_TURN = 0.02  # of slope, rise over run: at samples 5 cm apart the floor is then within 0.25 mm
_LIES = 0.05  # of a normal's length: steeper facets are walls


class Creases:
    """Places along the edges between two facets of the floor that differ in slope."""

    def __init__(self, facets: VolumeFacets) -> None:
        """Find the edges and cut them into pieces."""
        normal = facets.normals
        size = np.maximum(np.linalg.norm(normal, axis=1), 1e-30)
        lies = -normal[:, 2] > _LIES * size
        slope = -normal[:, :2] / np.where(lies, normal[:, 2], -1.0)[:, None]
        faces = facets.faces.astype(np.int64)
        edge = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
        owner = np.tile(np.arange(len(faces)), 3)
        _, pair = np.unique(np.sort(edge, axis=1), axis=0, return_inverse=True)
        order = np.argsort(pair.reshape(-1), kind="stable")
        one, two = owner[order[0::2]], owner[order[1::2]]  # the mesh is closed: each edge has two facets
        turned = lies[one] & lies[two] & (np.abs(slope[one] - slope[two]).max(axis=1) > _LEAST_TURN)
        a, b = np.moveaxis(facets.vertices[edge[order[0::2][turned]]], 1, 0)
        length = np.linalg.norm(b - a, axis=1)
        count = np.ceil(length / max(_STEP_M, float(length.sum()) / _MOST)).astype(int) + 1
        number, step = each_of(count)
        share = (step / np.maximum(count - 1, 1)[number])[:, None]
        places = a[number] + share * (b[number] - a[number])
        self._places = places[np.argsort(places[:, 0], kind="stable")]  # from west to east

    def within(self, low_m: np.ndarray, high_m: np.ndarray, beside_m: float) -> np.ndarray:
        """Return the places (k, 3) m in a box (2,) to (2,) m seen from above, and so far beside it."""
        low, high = low_m - beside_m, high_m + beside_m
        near = self._places[slice(*np.searchsorted(self._places[:, 0], [low[0], np.nextafter(high[0], np.inf)]))]
        found: np.ndarray = near[(near[:, 1] >= low[1]) & (near[:, 1] <= high[1])]
        return found
