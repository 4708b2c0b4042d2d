"""Lines at which a volume's floor turns: there it is farther from a plane than at samples between them."""

from __future__ import annotations

import numpy as np

from minexplore.floors.volume_arrays import VolumeFacets, each_of
from minexplore.volume.standing import keys_of

_STEP_M = 0.05  # between places of a crease
_MOST = 5_000_000  # places of all creases; a larger mine has them farther apart
_LEAST_TURN = 0.02  # of slope, rise over run: at samples 5 cm apart the floor is then within 0.25 mm
SQUARE_M = 0.2  # sides of the squares, seen from above, that creases are looked up by
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
        self._places, self._square = _by_square(places)

    def farthest_m(
        self, nodes_m: np.ndarray, planes: np.ndarray, floor_m: np.ndarray, reach_m: float, beside_m: float
    ) -> np.ndarray:
        """Return how far in height (n,) m creases are at most from planes, 0 where none are near.

        Parameters
        ----------
        nodes_m : (n, 2) float64, m
        planes : (n, 3) float64
            Slopes east and north and height, m, over the nodes.
        floor_m : (n,) float64, m
            The floors' heights there. Creases that are `beside_m` higher or lower are another floor's.
        reach_m : float
            Of the planes about the nodes, `SQUARE_M` at most.
        """
        node, place = self._about(nodes_m)
        away = place[:, :2] - nodes_m[node]
        near = away[:, 0] ** 2 + away[:, 1] ** 2 <= reach_m**2
        near &= np.abs(place[:, 2] - floor_m[node]) < beside_m
        node, away = node[near], away[near]
        own, found = planes[node], np.zeros(len(nodes_m))
        height = away[:, 0] * own[:, 0] + away[:, 1] * own[:, 1] + own[:, 2]
        np.maximum.at(found, node, np.abs(place[near, 2] - height))
        return found

    def _about(self, nodes_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return nodes, by number, and creases' places (k, 3) m in the nine squares about each node (n, 2) m."""
        at = np.floor(nodes_m / SQUARE_M).astype(int)
        rows = at[:, 1] + np.array([[-1], [0], [1]])
        first = self._square.searchsorted(keys_of(rows, at[:, 0] - 1).ravel())
        last = self._square.searchsorted(keys_of(rows, at[:, 0] + 1).ravel(), side="right")
        owner, step = each_of(last - first)
        return owner % len(nodes_m), self._places[first[owner] + step]


def _by_square(places_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return places (n, 3) m in the order of squares of the plan, row by row, and the keys (n,) of these."""
    at = np.floor(places_m[:, :2] / SQUARE_M).astype(int)
    key = keys_of(at[:, 1], at[:, 0])
    order = np.argsort(key, kind="stable")
    return places_m[order], key[order]
