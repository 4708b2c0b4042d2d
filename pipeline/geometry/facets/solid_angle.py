"""The solid angle of a closed mesh about places, of few triangles: what is far is seen as a cone over its border."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

_LEAST = 32  # facets of a block that is not halved
_TOGETHER = 1 << 18  # angles of triangles that are summed at once


@dataclass(frozen=True)
class _HalvedMesh:
    """Vertices (v, 3) m, facets (f, 3) of them, and the middles (f, 3) m of these."""

    vertices: np.ndarray
    faces: np.ndarray
    middles: np.ndarray


class _BoxedFacets:
    """Some facets of a mesh, which are halved when a place is in the box about them.

    Attributes
    ----------
    box : (2, 3) float64, m
    cone : (n, 3, 3) float64, m
        Triangles with the same border as the facets.
    corners : (k, 3, 3) float64, m
        Of the facets themselves; none of a block that is halved.
    """

    def __init__(self, mesh: _HalvedMesh, some: np.ndarray) -> None:
        self._mesh, self._some = mesh, some
        corners = mesh.vertices[mesh.faces[some]]
        points = corners.reshape(-1, 3)
        self.box = np.stack([points.min(axis=0), points.max(axis=0)])
        start, end = _border(mesh.faces[some], len(mesh.vertices))
        middle = np.broadcast_to(self.box.mean(axis=0), (len(start), 3))
        self.cone = np.stack([mesh.vertices[start], mesh.vertices[end], middle], axis=1)
        self.corners = corners if len(some) <= _LEAST else corners[:0]

    @cached_property
    def parts(self) -> tuple[_BoxedFacets, ...]:
        """Return the halves across the longest side; none of a block with few facets."""
        middles = self._mesh.middles[self._some]
        if len(middles) <= _LEAST:
            return ()
        half = len(middles) // 2
        order = self._some[np.argpartition(middles[:, int(np.ptp(middles, axis=0).argmax())], half)]
        return _BoxedFacets(self._mesh, order[:half]), _BoxedFacets(self._mesh, order[half:])


class SolidAngle:
    """Blocks of neighbouring facets in blocks, each with its border.

    From outside a box, all facets in it fill the same solid angle as any other surface in the box with the same border:
    here triangles from the border's edges to the middle of the box. A place is asked of the halves of a block only if
    it is in the block's box.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        """Take the facets (f, 3) of a closed mesh of vertices (v, 3) m as one block."""
        self._all = _BoxedFacets(_HalvedMesh(vertices, faces, vertices[faces].mean(axis=1)), np.arange(len(faces)))

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
