"""The floor under each wheel as one plane: what a wheel can touch of it in one control step is nearly flat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import open3d

from benchmarks.comparisons.volume.volume import Volume

NODE_M = 0.05  # between the places that planes are kept for
# A wheel's way in one control step is at most 0.2 m, so that it stays within 0.1 m of the way's middle. Braking and
# accelerating add 0.04 m, the nearest node 0.035 m.
REACH_M = 0.2
SPEED_MPS = 2.0  # of the fastest wheel on planes
TOLERANCE_M = 0.003  # of the floor from a plane; the survey allows 1 cm, and the floor follows it within 4 mm
_AROUND_M = 0.6  # of a tile: wheels of a robot that begins a control step on it
_LEDGE_M = 0.2  # higher ledges stop the chassis, whose lower edge is 0.13 m over the floor
_ASIDE_M = 0.4  # of a wheel's floor over or under the height that the robot's axle has: steeper floors have no plane
_SAME_M = 1e-4  # hits of one ray so near are on two facets that share an edge
_LEAST = 6  # places of a plane
_VALLEY, _RIDGE = 1.0, -1.0
_WAYS, _SORTINGS = 4, 3  # directions in which a crease is looked for, and how often its sides are sorted


TILE_M, _SLAB_M = 2.0, 0.5  # sides of the tiles that planes are made in
_SIDE_M = np.array([TILE_M, TILE_M, _SLAB_M])
_NODES = round((TILE_M + 2 * _AROUND_M) / NODE_M) + 1


@dataclass(frozen=True)
class FootPlanes:
    """Planes of the floor under k feet of n robots.

    Attributes
    ----------
    planes : (n, k, 2, 3) float64
        Slopes east and north and height, m, over the node, of two planes.
    bend : (n, k) float64
        0 if the two are one plane, 1 if the floor is the higher of them, a valley, -1 if the lower, a ridge.
    nodes_m : (n, k, 2) float64, m
        The node near each foot.
    error_m : (n, k) float64, m
        The floor's largest distance in height from the planes within `REACH_M` of the node; infinite without a floor.
    """

    planes: np.ndarray
    bend: np.ndarray
    nodes_m: np.ndarray
    error_m: np.ndarray

    def heights(self, feet_m: np.ndarray) -> np.ndarray:
        """Return the height (n, k) m of the planes at places (n, k, 2) m."""
        both = ((feet_m - self.nodes_m)[:, :, None] * self.planes[..., :2]).sum(axis=3) + self.planes[..., 2]
        found: np.ndarray = np.where(self.bend < 0, both.min(axis=2), both.max(axis=2))
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
        self._number: dict[tuple[int, ...], int] = {}
        self._table = np.zeros((1, _NODES, _NODES, 8), np.float32)

    def under(self, bodies_m: np.ndarray, feet_m: np.ndarray) -> FootPlanes:
        """Return the planes under the feet (n, k, 2) m of robots whose bodies are at places (n, 3) m."""
        rows = np.floor(bodies_m / _SIDE_M)
        numbers = np.array([self._numbered(tuple(map(int, row))) for row in rows.tolist()], dtype=int)
        first = (rows * _SIDE_M)[:, None, :2] - _AROUND_M
        at = np.rint((feet_m - first) / NODE_M).astype(int)
        outside = ((at < 0) | (at >= _NODES)).any(axis=2)
        at = np.clip(at, 0, _NODES - 1)
        found = self._table[numbers[:, None], at[..., 1], at[..., 0]].astype(float)
        nodes, error = first + at * NODE_M, np.where(outside, np.inf, found[..., 7])
        return FootPlanes(found[..., :6].reshape(*error.shape, 2, 3), found[..., 6], nodes, error)

    def _numbered(self, row: tuple[int, ...]) -> int:
        """Return the number of a tile's table; make it if it is new."""
        found = self._number.get(row)
        if found is None:
            found = self._number[row] = len(self._number)
            if found == len(self._table):
                self._table = np.concatenate([self._table, np.zeros_like(self._table)])
            self._table[found] = self._made(np.array(row) * _SIDE_M)
        return found

    def _made(self, low_m: np.ndarray) -> np.ndarray:
        """Return the planes and their errors (n, n, 8) for robots whose body is in the tile with this corner (3,) m."""
        reach = round(REACH_M / NODE_M)
        first = low_m[:2] - _AROUND_M
        side = NODE_M * (np.arange(_NODES + 2 * reach) - reach)
        y, x = np.meshgrid(first[1] + side, first[0] + side, indexing="ij")
        low, high = self._columns(np.column_stack([x.ravel(), y.ravel()]))
        low, high = (a.reshape(*x.shape, -1) for a in (low, high))
        inner = low[reach:-reach, reach:-reach]
        near = (inner > low_m[2] - _ASIDE_M) & (inner < low_m[2] + _SLAB_M + _ASIDE_M)
        floor = np.where(near.sum(axis=2) == 1, np.where(near, inner, 0).sum(axis=2), np.nan)
        return _fit(floor, low, high, reach)

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


def _fit(floor: np.ndarray, low: np.ndarray, high: np.ndarray, reach: int) -> np.ndarray:
    """Return the planes and errors (n, n, 8) of the floor (n, n) m about each node, as `FootPlanes` has them.

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
    good = np.isfinite(floor) & (is_free.sum(axis=2) >= _LEAST)
    found = np.zeros((n, n, 8))
    found[..., 7] = np.inf
    found[good] = _planes(places, rise[good], is_free[good])
    found[good, 2] += floor[good]
    found[good, 5] += floor[good]
    return found


def _planes(places: np.ndarray, rise: np.ndarray, is_free: np.ndarray) -> np.ndarray:
    """Return planes and errors (m, 8) of floors (m, k) m at places (k, 3), the last 1: two planes if they fit."""
    first = _least_squares(places, rise, is_free)
    off = np.where(is_free, rise - first @ places.T, np.nan)
    highest, lowest = np.nanmax(off, axis=1), np.nanmin(off, axis=1)
    first[:, 2] += (highest + lowest) / 2
    found = np.column_stack([first, first, np.zeros(len(first)), (highest - lowest) / 2])
    bent = np.flatnonzero(found[:, 7] > TOLERANCE_M)
    if len(bent):
        found[bent] = _creased(places, rise[bent], is_free[bent], found[bent])
    return found


def _least_squares(places: np.ndarray, rise: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the planes (m, 3) through floors (m, k) m at places (k, 3)."""
    squares = (weight.astype(float) @ (places[:, :, None] * places[:, None]).reshape(-1, 9)).reshape(-1, 3, 3)
    squares += 1e-9 * np.eye(3)
    found: np.ndarray = np.linalg.solve(squares, ((rise * weight) @ places)[..., None])[..., 0]
    return found


def _creased(places: np.ndarray, rise: np.ndarray, is_free: np.ndarray, single: np.ndarray) -> np.ndarray:
    """Return planes and errors (m, 8) of floors (m, k) m with a valley or a ridge, or what they were with one plane.

    The floor is parted by the sign of its distance from the plane that it was given, to one side of the middle and to
    the other: a crease's two sides are found by planes through either half and by sorting the places by them again.
    """
    best = single
    for angle in np.arange(_WAYS) * np.pi / _WAYS:
        side = places[:, 0] * np.cos(angle) + places[:, 1] * np.sin(angle) > 0
        one = np.broadcast_to(side, rise.shape)
        for _ in range(_SORTINGS):
            planes = [_least_squares(places, rise, is_free & part) for part in (one, ~one)]
            heights = [plane @ places.T for plane in planes]
            one = np.abs(heights[0] - rise) < np.abs(heights[1] - rise)
        for kind, joined in ((_VALLEY, np.maximum(*heights)), (_RIDGE, np.minimum(*heights))):
            error = np.abs(np.where(is_free, joined - rise, 0.0)).max(axis=1)
            row = np.column_stack([*planes, np.full(len(error), kind), error])
            best = np.where((error < best[:, 7])[:, None], row, best)
    return best
