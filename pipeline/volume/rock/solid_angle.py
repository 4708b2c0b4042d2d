"""The solid angle of a closed mesh about a place, of few triangles: what is far is seen as cones over its border."""

from __future__ import annotations

import numpy as np

_LEAST = 100  # facets of a block
_BORDER = 80  # edges of a block's border, about: as many facets in a block as edges in all borders take least time


class SolidAngle:
    """Blocks of neighbouring facets, each with its border.

    From outside a box, all facets in it fill the same solid angle as any other surface in the box with the same border:
    here triangles from the border's edges to the middle of the box. Only blocks whose box a place is in are summed
    facet by facet.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        """Part the facets (f, 3) of a closed mesh of vertices (v, 3) m into blocks, and find their borders."""
        self._corners = vertices[faces]
        self._blocks = _halved(self._corners.mean(axis=1), np.arange(len(faces)), _most(len(faces)))
        block = np.empty(len(faces), int)
        for number, facets in enumerate(self._blocks):
            block[facets] = number
        points = [self._corners[facets].reshape(-1, 3) for facets in self._blocks]
        self._low, self._high = (np.array([pick(some, axis=0) for some in points]) for pick in (np.min, np.max))
        start, end, self._of = _borders(faces, block, len(vertices))
        middle = ((self._low + self._high) / 2)[self._of]
        self._cones = np.stack([vertices[start], vertices[end], middle], axis=1)

    def are_enclosed(self, places: np.ndarray) -> np.ndarray:
        """Return about which places (n, 3) m the solid angle is 4 pi, and not 0 as outside the mesh."""
        found = np.zeros(len(places), bool)
        for number, place in enumerate(places):
            near = ((self._low <= place) & (place <= self._high)).all(axis=1)
            facets = [self._corners[self._blocks[k]] for k in np.flatnonzero(near).tolist()]
            found[number] = _angle(np.concatenate([self._cones[~near[self._of]], *facets]) - place) > 2 * np.pi
        return found


def _most(count: int) -> int:
    """Return how many facets a block may have: sums over one block and over all borders take equally long."""
    return max(_LEAST, int(np.sqrt(_BORDER * count)))


def _halved(middles: np.ndarray, some: np.ndarray, most: int) -> list[np.ndarray]:
    """Return blocks of some facets, which are halved across their longest side until none has too many."""
    if len(some) <= most:
        return [some]
    axis = int(np.ptp(middles[some], axis=0).argmax())
    order, half = np.argpartition(middles[some, axis], len(some) // 2), len(some) // 2
    return [block for part in (order[:half], order[half:]) for block in _halved(middles, some[part], most)]


def _borders(faces: np.ndarray, block: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return start, end and block (e,) of the edges that a block's facets pass more often in one way than the other."""
    start, end = faces.astype(np.int64).ravel(), np.roll(faces, -1, axis=1).astype(np.int64).ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    key, number = np.unique((np.repeat(block, 3) * count + low) * count + high, return_inverse=True)
    more = np.bincount(number, np.sign(end - start), len(key)).astype(int)
    key, more = np.repeat(key, np.abs(more)), np.repeat(more, np.abs(more))
    low, high = key // count % count, key % count
    return np.where(more > 0, low, high), np.where(more > 0, high, low), key // count**2


def _angle(triangles: np.ndarray) -> float:
    """Return the solid angle of triangles (n, 3, 3) about the origin, by van Oosterom and Strackee (1983)."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    x, y, z = (np.linalg.norm(one, axis=1) for one in (a, b, c))
    over = np.einsum("ij,ij->i", a, np.cross(b, c))
    under = x * y * z + (a * b).sum(axis=1) * z + (b * c).sum(axis=1) * x + (c * a).sum(axis=1) * y
    return float(2 * np.arctan2(over, under).sum())
