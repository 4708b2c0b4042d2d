"""The solid angle of a closed mesh about places, of few triangles: what is far is seen as a cone over its border."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_LEAST = 32  # facets of a block that is not halved
_TOGETHER = 1 << 18  # angles of triangles that are summed at once


@dataclass(frozen=True)
class _BoxedFacets:
    """A box (2, 3) m about facets, triangles (n, 3, 3) m with the same border, and halves, or the facets themselves."""

    box: np.ndarray
    cone: np.ndarray
    parts: tuple[_BoxedFacets, ...]
    corners: np.ndarray


class SolidAngle:
    """Blocks of neighbouring facets in blocks, each with its border.

    From outside a box, all facets in it fill the same solid angle as any other surface in the box with the same border:
    here triangles from the border's edges to the middle of the box. A place is asked of the halves of a block only if
    it is in the block's box.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        """Part the facets (f, 3) of a closed mesh of vertices (v, 3) m into blocks, and find their borders."""
        middles = vertices[faces].mean(axis=1)
        self._all = _block(vertices, faces, middles, np.arange(len(faces)))

    def are_enclosed(self, places: np.ndarray) -> np.ndarray:
        """Return about which places (n, 3) m the solid angle is 4 pi, and not 0 as outside the mesh."""
        angle = np.zeros(len(places))
        waiting = [(self._all, np.arange(len(places)))]
        while waiting:
            block, some = waiting.pop()
            near = ((block.box[0] <= places[some]) & (places[some] <= block.box[1])).all(axis=1)
            _add(angle, places, some[~near], block.cone)
            inside = some[near]
            if not len(inside):
                continue
            _add(angle, places, inside, block.corners)
            waiting += [(part, inside) for part in block.parts]
        return angle > 2 * np.pi


def _block(vertices: np.ndarray, faces: np.ndarray, middles: np.ndarray, some: np.ndarray) -> _BoxedFacets:
    """Return the block of some facets, which is halved across its longest side until none has too many."""
    corners = vertices[faces[some]]
    points = corners.reshape(-1, 3)
    box = np.stack([points.min(axis=0), points.max(axis=0)])
    start, end = _border(faces[some], len(vertices))
    cone = np.stack([vertices[start], vertices[end], np.broadcast_to(box.mean(axis=0), (len(start), 3))], axis=1)
    if len(some) <= _LEAST:
        return _BoxedFacets(box, cone, (), corners)
    axis, half = int(np.ptp(middles[some], axis=0).argmax()), len(some) // 2
    order = some[np.argpartition(middles[some, axis], half)]
    parts = tuple(_block(vertices, faces, middles, part) for part in (order[:half], order[half:]))
    return _BoxedFacets(box, cone, parts, corners[:0])


def _border(faces: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return start and end (e,) of the edges that facets pass more often in one way than the other."""
    start, end = faces.astype(np.int64).ravel(), np.roll(faces, -1, axis=1).astype(np.int64).ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    key, number = np.unique(low * count + high, return_inverse=True)
    more = np.bincount(number.reshape(-1), np.sign(end - start), len(key)).astype(int)
    key, more = np.repeat(key, np.abs(more)), np.repeat(more, np.abs(more))
    low, high = key // count, key % count
    return np.where(more > 0, low, high), np.where(more > 0, high, low)


def _add(angle: np.ndarray, places: np.ndarray, some: np.ndarray, triangles: np.ndarray) -> None:
    """Add the solid angle of triangles (n, 3, 3) about some places, by van Oosterom and Strackee (1983)."""
    if not len(triangles):
        return
    step = max(1, _TOGETHER // len(triangles))
    for k in range(0, len(some), step):
        rows = some[k : k + step]
        a, b, c = (triangles[:, n].T[:, None] - places[rows].T[:, :, None] for n in range(3))
        x, y, z = (np.sqrt((one * one).sum(axis=0)) for one in (a, b, c))
        over = (
            a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
        )
        under = x * y * z + (a * b).sum(axis=0) * z + (b * c).sum(axis=0) * x + (c * a).sum(axis=0) * y
        angle[rows] += 2 * np.arctan2(over, under).sum(axis=1)
