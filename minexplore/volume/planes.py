"""The floor under each foot as one plane: what a foot can touch of it in one control step is nearly flat."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

import numpy as np

from minexplore.volume.columns import FloorColumns
from minexplore.volume.creases import Creases

NODE_M = 0.05  # between the places that planes are kept for
# A plane holds for a foot that stays within one of these distances of a node in a control step: half of its way at
# these speeds at most, 0.035 m from the middle of the way to the nearest node, 0.04 m by braking or accelerating.
REACHES_M = (0.12, 0.2)
SPEEDS_MPS = (0.9, 2.0)
TOLERANCE_M = 0.005  # of the floor from a plane: the floor follows the survey within 4 mm, of which 1 cm is allowed
_AROUND_M = 0.6  # of a tile: feet of a robot that begins a control step on it
_LEDGE_M = 0.2  # higher ledges stop the chassis, whose lower edge is 0.13 m over the floor
_ASIDE_M = 0.4  # of a foot's floor over or under the height that the robot's axle has: steeper floors have no plane
_LEAST = 6  # places of a plane
TILE_M, _SLAB_M = 2.0, 0.5  # sides of the tiles that planes are made in
_SIDE_M = np.array([TILE_M, TILE_M, _SLAB_M])
_NODES = round((TILE_M + 2 * _AROUND_M) / NODE_M) + 1
_RIM = int(max(REACHES_M) / NODE_M + 1e-9)  # of nodes round a tile's, which are looked at only
_BLOCK = 8  # nodes a side whose planes are made together: one alone takes nearly as long
_KEPT = 512  # tiles, of 0.3 MB each
_KEPT_GRIDS = 64


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
        away = feet_m - self.nodes_m
        found: np.ndarray = away[..., 0] * self.plane[..., 0] + away[..., 1] * self.plane[..., 1] + self.plane[..., 2]
        return found


@dataclass(frozen=True)
class _Tile:
    """The nodes of a tile, with a rim of `_RIM` more: floors and roofs over and under them, and its creases' places.

    `floor` (n, n) m is that of each node near the tile's height, NaN if there is none or more than one.
    """

    first_m: np.ndarray
    low: np.ndarray
    high: np.ndarray
    floor: np.ndarray
    creases: np.ndarray


class FloorPlanes:
    """Planes of a volume's floors at nodes of a grid, each made when a foot first comes there."""

    def __init__(self, columns: FloorColumns, creases: Creases) -> None:
        """Take what finds the floors, and the lines at which they turn."""
        self._columns, self._creases = columns, creases
        self._tiles: OrderedDict[tuple[int, int, int], int] = OrderedDict()  # slots; oldest use first
        self._in_slot: dict[int, _Tile] = {}
        self._grids: OrderedDict[tuple[int, int], tuple[np.ndarray, ...]] = OrderedDict()
        self._table = np.zeros((0, _NODES, _NODES, len(REACHES_M), 4), np.float32)  # NaN where none was made yet

    def under(self, bodies_m: np.ndarray, feet_m: np.ndarray, speed_mps: np.ndarray) -> FootPlanes:
        """Return the planes under feet in a control step.

        Parameters
        ----------
        bodies_m : (n, 3) float64, m
            The robots' places, mine frame.
        feet_m : (n, k, 2) float64, m
            The middles of their feet's ways.
        speed_mps : (n, k) float64, m/s
            The feet's speeds.
        """
        rows = np.floor(bodies_m / _SIDE_M)
        slots = self._slots([(x, y, z) for x, y, z in rows.astype(int).tolist()])
        first = (rows * _SIDE_M)[:, None, :2] - _AROUND_M
        at = np.rint((feet_m - first) / NODE_M).astype(int)
        outside = ((at < 0) | (at >= _NODES)).any(axis=2)
        at = np.clip(at, 0, _NODES - 1)
        reach = np.searchsorted(SPEEDS_MPS, speed_mps)
        outside |= reach == len(SPEEDS_MPS)
        reach = np.minimum(reach, len(SPEEDS_MPS) - 1)
        place = slots[:, None], at[..., 1], at[..., 0], reach
        found = self._table[place]
        absent = np.isnan(found[..., 3])
        if absent.any():
            for slot in np.unique(slots[absent.any(axis=1)]).tolist():
                own = absent & (slots == slot)[:, None]
                for number in np.unique(reach[own]).tolist():
                    self._make(slot, at[own & (reach == number)], number)
            found = self._table[place]
        found = found.astype(float)
        return FootPlanes(found[..., :3], first + at * NODE_M, np.where(outside, np.inf, found[..., 3]))

    def _slots(self, rows: list[tuple[int, int, int]]) -> np.ndarray:
        """Return where the tables (n,) of tiles are, made if they are new."""
        unique = dict.fromkeys(rows)
        for row in unique:
            if row in self._tiles:
                self._tiles.move_to_end(row)
                continue
            most = max(_KEPT, len(unique))
            if len(self._tiles) < most:
                slot = len(self._tiles)
                if slot == len(self._table):
                    self._table = np.concatenate([self._table, np.zeros((max(slot, 4), *self._table.shape[1:]), "f4")])
            else:
                slot = self._tiles.popitem(last=False)[1]
            self._table[slot] = np.nan
            self._tiles[row], self._in_slot[slot] = slot, self._tile(row)
        return np.array([self._tiles[row] for row in rows], dtype=int)

    def _tile(self, row: tuple[int, int, int]) -> _Tile:
        first, bottom = np.array(row[:2]) * TILE_M - _AROUND_M, row[2] * _SLAB_M
        low, high = self._grid(row[:2], first)
        near = (low > bottom - _ASIDE_M) & (low < bottom + _SLAB_M + _ASIDE_M)
        floor = np.where(near.sum(axis=2) == 1, np.where(near, low, 0).sum(axis=2), np.nan)
        return _Tile(first, low, high, floor, self._creases.within(first, first + NODE_M * (_NODES - 1), _RIM * NODE_M))

    def _grid(self, tile: tuple[int, int], first_m: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the floors and the roofs (n, n, k) m over and under the nodes of a tile and its rim."""
        if tile not in self._grids:
            count = _NODES + 2 * _RIM
            hits = self._columns.grid_hits(first_m - _RIM * NODE_M, NODE_M, count)
            spans = self._columns.spans(hits, count * count)
            self._grids[tile] = tuple(side.reshape(count, count, -1) for side in spans)
            while len(self._grids) > _KEPT_GRIDS:
                self._grids.popitem(last=False)
        self._grids.move_to_end(tile)
        return self._grids[tile]

    def _make(self, slot: int, nodes: np.ndarray, reach: int) -> None:
        """Make the planes of nodes (m, 2), column and row, of the tile in a slot, and of all in their blocks."""
        blocks = np.array(sorted({(x, y) for x, y in (nodes // _BLOCK * _BLOCK).tolist()}))
        within = np.stack(np.meshgrid(*[np.arange(_BLOCK)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
        nodes = (blocks[:, None] + within).reshape(-1, 2)
        nodes = nodes[(nodes < _NODES).all(axis=1)]
        made = _fit(self._in_slot[slot], nodes, REACHES_M[reach])
        self._table[slot, nodes[:, 1], nodes[:, 0], reach] = made


def _fit(tile: _Tile, nodes: np.ndarray, reach_m: float) -> np.ndarray:
    """Return slopes, height and error (m, 4) of the floor within a reach of nodes (m, 2) of a tile.

    What is rock at `_LEDGE_M` over the node's floor is left out: the chassis stops there.
    """
    i, j = (a.ravel() for a in np.meshgrid(*[np.arange(-_RIM, _RIM + 1)] * 2, indexing="ij"))
    disc = np.hypot(i, j) * NODE_M <= reach_m + 1e-9
    i, j = i[disc], j[disc]
    row, col = nodes[:, 1] + _RIM, nodes[:, 0] + _RIM
    floor = tile.floor[row, col]
    at = row[:, None] + i, col[:, None] + j
    over = (floor + _LEDGE_M)[:, None, None]
    low = tile.low[at]
    within = (low <= over) & (over < tile.high[at])
    is_free = within.any(axis=-1)
    rise = np.where(is_free, np.where(within, low, 0).sum(axis=-1) - floor[:, None], 0.0)
    good = np.isfinite(floor) & (is_free.sum(axis=1) >= _LEAST)
    found = np.zeros((len(nodes), 4))
    found[:, 3] = np.inf
    found[good] = fit_planes(np.column_stack([j, i]) * NODE_M, rise[good], is_free[good])
    found[good, 2] += floor[good]
    here = tile.first_m + nodes[good] * NODE_M
    found[good, 3] = np.maximum(found[good, 3], _off_at(tile.creases, here, found[good], floor[good], reach_m))
    return found


def _off_at(
    creases: np.ndarray, nodes_m: np.ndarray, planes: np.ndarray, floor_m: np.ndarray, reach_m: float
) -> np.ndarray:
    """Return how far (m,) m the places (k, 3) m of creases within a reach of nodes (m, 2) m are from their planes.

    Between the samples the floor is farthest from the plane where it turns. Places that are not about the node's floor
    are another floor's.
    """
    if not len(nodes_m):
        return np.zeros(0)
    low, high = nodes_m.min(axis=0) - reach_m, nodes_m.max(axis=0) + reach_m
    creases = creases[((creases[:, :2] >= low) & (creases[:, :2] <= high)).all(axis=1)]
    away = creases[None, :, :2] - nodes_m[:, None]
    near = away[..., 0] ** 2 + away[..., 1] ** 2 <= reach_m**2
    near &= np.abs(creases[None, :, 2] - floor_m[:, None]) < _LEDGE_M
    height = away[..., 0] * planes[:, :1] + away[..., 1] * planes[:, 1:2] + planes[:, 2:3]
    found: np.ndarray = np.where(near, np.abs(creases[None, :, 2] - height), 0.0).max(axis=1, initial=0.0)
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
    weight = is_free.astype(float)
    # Sums by `einsum`, as products by BLAS are rounded by how many rows there are.
    products = (row[:, :, None] * row[:, None]).reshape(-1, 9)
    squares = np.einsum("mk,kp->mp", weight, products).reshape(-1, 3, 3) + 1e-9 * np.eye(3)
    plane = np.linalg.solve(squares, np.einsum("mk,ki->mi", rise_m * weight, row)[..., None])[..., 0]
    height = plane[:, :1] * row[:, 0] + plane[:, 1:2] * row[:, 1] + plane[:, 2:]
    off = rise_m - height
    highest = np.where(is_free, off, -np.inf).max(axis=1, initial=-np.inf)
    lowest = np.where(is_free, off, np.inf).min(axis=1, initial=np.inf)
    plane[:, 2] += (highest + lowest) / 2
    return np.column_stack([plane, (highest - lowest) / 2])
