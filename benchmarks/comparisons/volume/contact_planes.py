"""The floor under each wheel as one plane: what a wheel can touch of it in one control step is nearly flat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import open3d

from benchmarks.comparisons.volume.volume import Volume

NODE_M = 0.05  # between the places that planes are kept for
# A wheel's way in one control step is at most 0.19 m, so that it stays within 0.1 m of its middle. Braking and
# accelerating add 0.04 m, the nearest node 0.035 m.
REACH_M = 0.2
TOLERANCE_M = 0.003  # of the floor from a plane; the survey allows 1 cm, and the floor follows it within 4 mm
_AROUND_M = 0.6  # of a tile: wheels of a robot that begins a control step on it
_LEDGE_M = 0.2  # higher ledges stop the chassis, whose lower edge is 0.13 m over the floor
_ASIDE_M = 0.4  # of a wheel's floor over or under the height that the robot's axle has: steeper floors have no plane
_SAME_M = 1e-4  # hits of one ray so near are on two facets that share an edge
_LEAST = 6  # places of a plane


@dataclass(frozen=True)
class PlaneTile:
    """Planes of the floor about the nodes of a tile: `plane` (n, n, 3) is slope east, slope north and height, m.

    Nodes are counted from `first_m` (2,), rows go north. `error_m` (n, n) is the floor's largest distance in height
    from the plane within `REACH_M`; infinite where the floor is none or not known.
    """

    first_m: np.ndarray
    plane: np.ndarray
    error_m: np.ndarray


class FloorPlanes:
    """Makes the planes of tiles of a volume."""

    def __init__(self, volume: Volume) -> None:
        """Index the facets for rays."""
        self._middle = volume.vertices.mean(axis=0)
        self._corners = volume.vertices[volume.faces] - self._middle
        self._normal = volume.normals
        self._top = float(self._corners[:, :, 2].max()) + 1.0
        self._scene = open3d.t.geometry.RaycastingScene(nthreads=1)
        self._scene.add_triangles(
            (volume.vertices - self._middle).astype(np.float32), volume.faces.astype(np.uint32)
        )

    def tile(self, low_m: np.ndarray, high_m: np.ndarray) -> PlaneTile:
        """Return the planes for robots whose body is in a box (3,) to (3,) m when a control step begins."""
        reach = round(REACH_M / NODE_M)
        count = round((high_m[0] - low_m[0] + 2 * _AROUND_M) / NODE_M) + 1
        first = low_m[:2] - _AROUND_M
        side = NODE_M * (np.arange(count + 2 * reach) - reach)
        y, x = np.meshgrid(first[1] + side, first[0] + side, indexing="ij")
        low, high = self._columns(np.column_stack([x.ravel(), y.ravel()]))
        low, high = (a.reshape(*x.shape, -1) for a in (low, high))
        inner = slice(reach, reach + count)
        near = (low[inner, inner] > low_m[2] - _ASIDE_M) & (low[inner, inner] < high_m[2] + _ASIDE_M)
        floor = np.where(near.sum(axis=2) == 1, np.where(near, low[inner, inner], 0).sum(axis=2), np.nan)
        plane, error = _fit(floor, low, high, reach)
        return PlaneTile(first, plane, error)

    def _columns(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return floors and roofs (n, k) m of the free spaces over and under places (n, 2); NaN behind the last."""
        local = places - self._middle[:2]
        rays = np.column_stack([local, np.full(len(local), self._top), np.tile([0, 0, -1.0], (len(local), 1))])
        found = self._scene.list_intersections(open3d.core.Tensor(rays.astype(np.float32)), nthreads=1)
        ray = found["ray_ids"].numpy().astype(np.int64)
        facet = found["primitive_ids"].numpy().astype(np.int64)
        a, normal = self._corners[facet, 0], self._normal[facet]
        steep = np.abs(normal[:, 2]) < 1e-6 * np.linalg.norm(normal, axis=1)
        z = a[:, 2] - np.sum((local[ray] - a[:, :2]) * normal[:, :2], axis=1) / np.where(steep, 1.0, normal[:, 2])
        ray, z, is_floor = ray[~steep], z[~steep] + self._middle[2], normal[~steep, 2] < 0
        order = np.lexsort([z, ray])
        ray, z, is_floor = ray[order], z[order], is_floor[order]
        again = np.append(False, (np.diff(ray) == 0) & (np.diff(z) < _SAME_M) & (is_floor[1:] == is_floor[:-1]))
        ray, z, is_floor = ray[~again], z[~again], is_floor[~again]
        pairs = np.flatnonzero((ray[1:] == ray[:-1]) & is_floor[:-1] & ~is_floor[1:])
        owner = ray[pairs]
        number = np.arange(len(owner)) - np.searchsorted(owner, owner)
        size = (len(places), int(number.max(initial=0)) + 1)
        low, high = np.full(size, np.nan), np.full(size, np.nan)
        low[owner, number], high[owner, number] = z[pairs], z[pairs + 1]
        return low, high


def _fit(floor: np.ndarray, low: np.ndarray, high: np.ndarray, reach: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the planes (n, n, 3) of the floor (n, n) m about each node and their errors (n, n) m.

    What is rock at `_LEDGE_M` over the node's floor is left out: the chassis stops there.
    """
    n = len(floor)
    step = np.arange(-reach, reach + 1)
    i, j = (a.ravel() for a in np.meshgrid(step, step, indexing="ij"))
    disc = np.hypot(i, j) * NODE_M <= REACH_M + 1e-9
    i, j = i[disc], j[disc]
    row, col = np.indices((n, n))
    at = row[..., None] + reach + i, col[..., None] + reach + j
    over = floor[..., None, None] + _LEDGE_M
    within = (low[at] <= over) & (over < high[at])
    is_free = within.any(axis=-1)
    rise = np.where(is_free, np.where(within, low[at], 0).sum(axis=-1) - floor[..., None], 0.0)
    places = np.column_stack([j, i, np.ones(len(i))]) * [NODE_M, NODE_M, 1]
    squares = np.einsum("abk,ki,kj->abij", is_free, places, places)
    squares += 1e-9 * np.eye(3)
    plane = np.linalg.solve(squares, np.einsum("abk,ki->abi", rise, places)[..., None])[..., 0]
    off = np.where(is_free, rise - plane @ places.T, np.nan)
    good = np.isfinite(floor) & (is_free.sum(axis=2) >= _LEAST)
    off[~good] = 0.0
    highest, lowest = np.nanmax(off, axis=2), np.nanmin(off, axis=2)
    plane[..., 2] += floor + (highest + lowest) / 2
    return plane, np.where(good, (highest - lowest) / 2, np.inf)
