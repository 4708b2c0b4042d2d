"""The winding number of a mesh with holes about places of a grid: which share of all directions its triangles fill."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.geometry.ray_scene import ray_scene

_ASIDE = (
    0.0,
    0.013,
    -0.017,
    0.019,
)  # of a cell: a ray that meets an edge is cast again, as its hits do not add up
_FAR = 4.0  # radii of a cap: from there it is a dipole, to 1 %
_BESIDE_M = 1e-3  # of a facet: the place that is tried
_AT_ONCE = 50_000  # pairs of places and triangles in memory


class WindingNumber:
    """Counts how often a mesh goes about a place; holes make it a fraction (Jacobson et al. 2013).

    Each border gets a cap: triangles from its edges to its middle. About a place, mesh and caps go a whole number of
    times: the sum of what a ray meets on its way down. The caps' own share is their solid angle, and is taken off.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        """Cap the borders of triangles (m, 3) between vertices (n, 3) m; their normals point out of the space."""
        start, end = _border(faces, len(vertices))
        graph = coo_matrix((np.ones(len(start)), (start, end)), (len(vertices),) * 2)
        of = np.unique(connected_components(graph, directed=False)[1][start], return_inverse=True)[1].reshape(-1)
        count = np.bincount(of)
        middle = np.stack([np.bincount(of, vertices[start, k]) for k in range(3)], axis=1) / count[:, None]
        self._caps = np.stack([vertices[end], vertices[start], middle[of]], axis=1)
        self._of, self._middles = of, middle
        far = np.linalg.norm(vertices[start] - middle[of], axis=1)
        self._radii = np.zeros(len(middle))
        np.maximum.at(self._radii, of, far)
        flat = np.cross(self._caps[:, 1] - self._caps[:, 0], self._caps[:, 2] - self._caps[:, 0]) / 2
        self._areas = np.stack([np.bincount(of, flat[:, k]) for k in range(3)], axis=1)
        corners = np.concatenate([vertices[faces], self._caps])
        self._middle = corners.reshape(-1, 3).mean(axis=0)
        own = corners - self._middle
        self._floor = float(own[..., 2].min()) - 1.0
        self._ups = np.sign(np.cross(own[:, 1] - own[:, 0], own[:, 2] - own[:, 0])[:, 2])
        self._scene = _scene(own)
        self._cap_scene = _scene(own[len(faces) :]) if len(start) else None
        self.border_m = np.bincount(of, np.linalg.norm(vertices[end] - vertices[start], axis=1))
        self.volume_m3 = float(np.einsum("ij,ij->i", own[:, 0], np.cross(own[:, 1], own[:, 2])).sum() / 6)

    def to_caps_m(self, places: np.ndarray) -> np.ndarray:
        """Return the distance (n,) m of places (n, 3) m from the nearest cap."""
        if self._cap_scene is None:
            return np.full(len(places), np.inf)
        return np.asarray(self._cap_scene.compute_distance((places - self._middle).astype(np.float32)).numpy())

    def of_mesh_and_caps(self, places: np.ndarray, column: np.ndarray, cell_m: float) -> np.ndarray:
        """Return how often (n,) mesh and caps go about places (n, 3) m, in vertical columns numbered (n,)."""
        own = places - self._middle
        _, first, of = np.unique(column, return_index=True, return_inverse=True)
        of = of.reshape(-1)
        found, rows = np.zeros(len(places), int), np.arange(len(places))
        left = np.arange(len(first))
        for aside in _ASIDE:
            start = own[first[left], :2] + aside * cell_m
            rays = np.zeros((len(left), 6), np.float32)
            rays[:, :2], rays[:, 2], rays[:, 5] = start, self._floor, 1.0
            hits = self._scene.list_intersections(rays)
            ray = hits["ray_ids"].numpy().astype(np.int64)
            height = hits["t_hit"].numpy().astype(np.float64) + self._floor
            turn = -self._ups[hits["primitive_ids"].numpy().astype(np.int64)].astype(int)
            order = np.lexsort((height, ray))
            ray, height, total = ray[order], height[order], np.append(0, np.cumsum(turn[order]))
            number = np.full(len(first), -1)
            number[left] = np.arange(len(left))
            own_ray = number[of[rows]]
            starts = np.searchsorted(ray, np.arange(len(left) + 1))
            span = 2.0 * (np.abs(own[:, 2]).max(initial=0.0) + np.abs(height).max(initial=0.0) + 1.0)
            at = np.searchsorted(ray * span + height, own_ray * span + own[rows, 2])
            found[rows] = total[at] - total[starts[own_ray]]
            open_rays = np.flatnonzero(total[starts[1:]] != total[starts[:-1]])
            left = left[open_rays]
            if not len(left):
                break
            rows = rows[np.isin(own_ray, open_rays)]
        return found

    def of_caps(self, places: np.ndarray) -> np.ndarray:
        """Return the caps' share (n,) of all directions about places (n, 3) m, positive on their inner side."""
        found = np.zeros(len(places))
        for k, (middle, radius) in enumerate(zip(self._middles, self._radii, strict=True)):
            away = middle - places
            far_m = np.linalg.norm(away, axis=1)
            near = far_m < _FAR * radius
            found[~near] += (away[~near] @ self._areas[k]) / far_m[~near] ** 3
            found[near] += _solid_angles(places[near], self._caps[self._of == k])
        return found / (4 * np.pi)


def share_crossed(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Return the share of the facets (m, 3) of a closed mesh whose outer side is in the mesh, or whose inner is not.

    Facets that cross part some of what they enclose from the rest.
    """
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-30)[:, None]
    outside = (a + b + c) / 3 + _BESIDE_M * normal
    about = WindingNumber(vertices, faces).of_mesh_and_caps(outside, np.arange(len(outside)), _BESIDE_M)
    return float((about != 0).mean())


def _scene(triangles: np.ndarray) -> Any:
    return ray_scene(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))


def _border(faces: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return start and end (e,) of the edges that triangles pass more often in one way than in the other."""
    start, end = faces.astype(np.int64).T.reshape(-1), np.roll(faces, -1, axis=1).astype(np.int64).T.reshape(-1)
    low, high = np.minimum(start, end), np.maximum(start, end)
    key, number = np.unique(low * count + high, return_inverse=True)
    more = np.rint(np.bincount(number.reshape(-1), np.sign(end - start), len(key))).astype(int)
    key, more = np.repeat(key, np.abs(more)), np.repeat(more, np.abs(more))
    low, high = key // count, key % count
    return np.where(more > 0, low, high), np.where(more > 0, high, low)


def _solid_angles(places: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the solid angle (n,) of triangles (m, 3, 3) about places (n, 3), by van Oosterom and Strackee (1983).

    Its products are linear in a place but for its square, so that they are products of matrices.
    """
    middle = triangles.reshape(-1, 3).mean(axis=0)
    a, b, c = np.moveaxis(triangles - middle, 1, 0)
    normal = np.cross(a, b) + np.cross(b, c) + np.cross(c, a)
    box = np.einsum("ij,ij->i", a, np.cross(b, c))
    found = np.zeros(len(places))
    step = max(1, _AT_ONCE // max(len(triangles), 1))
    for k in range(0, len(places), step):
        own = places[k : k + step] - middle
        square = np.einsum("ij,ij->i", own, own)[:, None]
        x, y, z = (
            np.sqrt(np.maximum(square - 2 * own @ one.T + np.einsum("ij,ij->i", one, one), 0.0)) for one in (a, b, c)
        )
        under = x * y * z
        for one, other, size in ((a, b, z), (b, c, x), (c, a, y)):
            under += (square - own @ (one + other).T + np.einsum("ij,ij->i", one, other)) * size
        angle = np.arctan2((box - own @ normal.T).astype(np.float32), under.astype(np.float32))
        found[k : k + step] = 2 * angle.sum(axis=1, dtype=np.float64)
    return found
