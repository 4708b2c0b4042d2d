"""The floor under each wheel as one plane: what a wheel can touch of it in one control step is nearly flat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import open3d

from pipeline.volume.union import Volume

NODE_M = 0.05  # between the places that planes are kept for
# A plane holds for a wheel that stays within one of these distances of a node in a control step: half of its way at
# these speeds at most, 0.035 m from the middle of the way to the nearest node, 0.04 m by braking or accelerating.
REACHES_M = (0.12, 0.2)
SPEEDS_MPS = (0.9, 2.0)
TOLERANCE_M = 0.005  # of the floor from a plane: the floor follows the survey within 4 mm, of which 1 cm is allowed
_AROUND_M = 0.6  # of a tile: wheels of a robot that begins a control step on it
_LEDGE_M = 0.2  # higher ledges stop the chassis, whose lower edge is 0.13 m over the floor
_ASIDE_M = 0.4  # of a wheel's floor over or under the height that the robot's axle has: steeper floors have no plane
_SAME_M = 1e-4  # hits of one ray so near are on two facets that share an edge
_LEAST = 6  # places of a plane
TILE_M, _SLAB_M = 2.0, 0.5  # sides of the tiles that planes are made in
_SIDE_M = np.array([TILE_M, TILE_M, _SLAB_M])
_NODES = round((TILE_M + 2 * _AROUND_M) / NODE_M) + 1


@dataclass(frozen=True)
class FootPlanes:
    """Planes of the floor under k feet of n robots.

    Attributes
    ----------
    plane : (n, k, 3) float64
        Slopes east and north and height, m, over the node.
    nodes_m : (n, k, 2) float64, m
        The node near each foot.
    error_m : (n, k) float64, m
        The floor's largest distance in height from the plane within the foot's reach; infinite without a floor.
    """

    plane: np.ndarray
    nodes_m: np.ndarray
    error_m: np.ndarray

    def heights(self, feet_m: np.ndarray) -> np.ndarray:
        """Return the height (n, k) m of the planes at places (n, k, 2) m."""
        found: np.ndarray = ((feet_m - self.nodes_m) * self.plane[..., :2]).sum(axis=2) + self.plane[..., 2]
        return found


class FloorPlanes:
    """Planes of a volume's floors at nodes of a grid, made tile by tile when robots come there."""

    def __init__(self, volume: Volume) -> None:
        """Index the facets for rays."""
        self._middle = volume.vertices.mean(axis=0)
        self._corners = volume.vertices[volume.faces] - self._middle
        self._normal = volume.normals
        self._top = float(self._corners[:, :, 2].max()) + 1.0
        self._scene = open3d.t.geometry.RaycastingScene(nthreads=1)
        self._scene.add_triangles((volume.vertices - self._middle).astype(np.float32), volume.faces.astype(np.uint32))
        self._number: dict[tuple[int, int, int], int] = {}
        self._table = np.zeros((1, _NODES, _NODES, len(REACHES_M), 4), np.float32)

    def under(self, bodies_m: np.ndarray, feet_m: np.ndarray, speed_mps: np.ndarray) -> FootPlanes:
        """Return the planes under feet in a control step.

        Parameters
        ----------
        bodies_m : (n, 3) float64, m
            The robots' places.
        feet_m : (n, k, 2) float64, m
            The middles of their feet's ways.
        speed_mps : (n, k) float64, m/s
            The feet's horizontal speeds.
        """
        rows = np.floor(bodies_m / _SIDE_M)
        numbers = np.array([self._numbered((x, y, z)) for x, y, z in rows.astype(int).tolist()], dtype=int)
        first = (rows * _SIDE_M)[:, None, :2] - _AROUND_M
        at = np.rint((feet_m - first) / NODE_M).astype(int)
        outside = ((at < 0) | (at >= _NODES)).any(axis=2)
        at = np.clip(at, 0, _NODES - 1)
        reach = np.searchsorted(SPEEDS_MPS, speed_mps)
        outside |= reach == len(SPEEDS_MPS)
        reach = np.minimum(reach, len(SPEEDS_MPS) - 1)
        found = self._table[numbers[:, None], at[..., 1], at[..., 0], reach].astype(float)
        return FootPlanes(found[..., :3], first + at * NODE_M, np.where(outside, np.inf, found[..., 3]))

    def floors_under(self, places_m: np.ndarray) -> np.ndarray:
        """Return the height (n,) m of the first floor at or under places (n, 3) m, NaN where there is none."""
        low, _ = self._columns(places_m[:, :2])
        return np.fmax.reduce(np.where(low <= places_m[:, 2:], low, np.nan), axis=1)

    def _numbered(self, row: tuple[int, int, int]) -> int:
        """Return the number of a tile's table; make it if it is new."""
        found = self._number.get(row)
        if found is None:
            found = self._number[row] = len(self._number)
            if found == len(self._table):
                self._table = np.concatenate([self._table, np.zeros_like(self._table)])
            self._table[found] = self._made(np.array(row) * _SIDE_M)
        return found

    def _made(self, low_m: np.ndarray) -> np.ndarray:
        """Return planes and errors (n, n, 2, 4) for robots whose body is in the tile with this corner (3,) m."""
        reach = int(max(REACHES_M) / NODE_M + 1e-9)
        first = low_m[:2] - _AROUND_M
        side = NODE_M * (np.arange(_NODES + 2 * reach) - reach)
        y, x = np.meshgrid(first[1] + side, first[0] + side, indexing="ij")
        low, high = self._columns(np.column_stack([x.ravel(), y.ravel()]))
        low, high = (a.reshape(*x.shape, -1) for a in (low, high))
        inner = low[reach:-reach, reach:-reach]
        near = (inner > low_m[2] - _ASIDE_M) & (inner < low_m[2] + _SLAB_M + _ASIDE_M)
        floor = np.where(near.sum(axis=2) == 1, np.where(near, inner, 0).sum(axis=2), np.nan)
        return np.stack([_fit(floor, low, high, reach, radius) for radius in REACHES_M], axis=2)

    def _columns(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return floors and roofs (n, k) m of the free spaces over and under places (n, 2); NaN behind the last."""
        if not len(places):  # Open3D 0.20 crashes
            return np.zeros((0, 1)), np.zeros((0, 1))
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


def _fit(floor: np.ndarray, low: np.ndarray, high: np.ndarray, margin: int, reach_m: float) -> np.ndarray:
    """Return slopes, height and error (n, n, 4) of the floor (n, n) m within a reach of each node.

    `low` and `high` have as many more rows and columns on each side as `margin` says. What is rock at `_LEDGE_M` over
    the node's floor is left out: the chassis stops there.
    """
    n = len(floor)
    step = np.arange(-margin, margin + 1)
    i, j = (a.ravel() for a in np.meshgrid(step, step, indexing="ij"))
    disc = np.hypot(i, j) * NODE_M <= reach_m + 1e-9
    i, j = i[disc], j[disc]
    row, col = np.indices((n, n))
    at = row[..., None] + margin + i, col[..., None] + margin + j
    over = floor[..., None, None] + _LEDGE_M
    within = (low[at] <= over) & (over < high[at])
    is_free = within.any(axis=-1)
    rise = np.where(is_free, np.where(within, low[at], 0).sum(axis=-1) - floor[..., None], 0.0)
    places = np.column_stack([j, i]) * NODE_M
    good = np.isfinite(floor) & (is_free.sum(axis=2) >= _LEAST)
    found = np.zeros((n, n, 4))
    found[..., 3] = np.inf
    found[good] = fit_planes(places, rise[good], is_free[good])
    found[good, 2] += floor[good]
    return found


def fit_planes(places_m: np.ndarray, rise_m: np.ndarray, is_free: np.ndarray) -> np.ndarray:
    """Return planes of floors: slopes east and north, height at the middle and largest error (m, 4).

    Parameters
    ----------
    places_m : (k, 2) float64, m
        From the middle.
    rise_m : (m, k) float64, m
        The floors' heights there.
    is_free : (m, k) bool
        What counts.
    """
    row = np.column_stack([places_m, np.ones(len(places_m))])
    squares = (is_free.astype(float) @ (row[:, :, None] * row[:, None]).reshape(-1, 9)).reshape(-1, 3, 3)
    squares += 1e-9 * np.eye(3)
    plane = np.linalg.solve(squares, ((rise_m * is_free) @ row)[..., None])[..., 0]
    off = np.where(is_free, rise_m - plane @ row.T, np.nan)
    highest, lowest = np.nanmax(off, axis=1), np.nanmin(off, axis=1)
    plane[:, 2] += (highest + lowest) / 2
    return np.column_stack([plane, (highest - lowest) / 2])
