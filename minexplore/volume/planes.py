"""The floor under each foot as one plane: what a foot can touch of it in one control step is nearly flat."""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass

import numpy as np

from minexplore.volume.columns import FloorColumns
from minexplore.volume.creases import Creases

NODE_M = 0.05  # between the places that planes are kept for
# A plane holds for a foot that stays within one of these distances of a node in a control step: half of its way at
# these speeds at most, 0.035 m from the middle of the way to the nearest node, 0.04 m by braking or accelerating.
REACHES_M = (0.12, 0.2)
SPEEDS_MPS = np.array([0.9, 2.0])
TOLERANCE_M = 0.005  # of the floor from a plane: the floor follows the survey within 4 mm, of which 1 cm is allowed
_AROUND_M = 0.6  # of a tile: feet of a robot that begins a control step on it
_LEDGE_M = 0.2  # higher ledges stop the chassis, whose lower edge is 0.13 m over the floor
_ASIDE_M = 0.4  # of a foot's floor over or under the height that the robot's axle has: steeper floors have no plane
_LEAST = 6  # places of a plane
TILE_M, _SLAB_M = 2.0, 0.5  # sides of the tiles that planes are made in
_SIDE_M = np.array([TILE_M, TILE_M, _SLAB_M])
_NODES = round((TILE_M + 2 * _AROUND_M) / NODE_M) + 1
_RIM = int(max(REACHES_M) / NODE_M + 1e-9)  # of nodes round a tile's, which are looked at only
_TOGETHER = 64  # planes that are made in one call, of nodes beside those asked for too: one takes nearly as long
_WIDTH = _NODES + 2 * _RIM
_SEVERAL_M = -1e3  # instead of a floor's height where floors lie over each other: no plane is near it
_KEPT = 512  # tiles, of 0.2 MB each
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


def _disc(reach_m: float) -> np.ndarray:
    """Return columns and rows (k, 2) of the nodes within a reach, from its middle."""
    near = np.arange(-_RIM, _RIM + 1)
    places = np.stack(np.meshgrid(near, near), axis=-1).reshape(-1, 2)
    return places[np.hypot(*places.T) * NODE_M <= reach_m + 1e-9]


_DISCS = tuple(_disc(reach_m) for reach_m in REACHES_M)


class FloorPlanes:
    """Planes of a volume's floors at nodes of a grid, each made when a foot first comes there."""

    def __init__(self, columns: FloorColumns, creases: Creases) -> None:
        """Take what finds the floors, and the lines at which they turn."""
        self._columns, self._creases = columns, creases
        self._slot: OrderedDict[tuple[int, int, int], int] = OrderedDict()  # of a tile; oldest use first
        self._grids: OrderedDict[tuple[int, int], tuple[np.ndarray, ...]] = OrderedDict()
        # By slot: planes, NaN where none was made yet; the first node and the height that the tile begins at, m; floor
        # and roof over that height at its nodes and those of its rim, NaN in rock.
        self._planes = np.zeros((0, _NODES, _NODES, len(REACHES_M), 4), np.float32)
        self._first, self._floor, self._roof = np.zeros((0, 3)), *np.zeros((2, 0, _WIDTH, _WIDTH), np.float32)

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
        first = self._first[slots, None, :2]
        at = np.rint((feet_m - first) / NODE_M).astype(int)
        reach = SPEEDS_MPS.searchsorted(speed_mps)
        # Seen as a number without sign, one below zero is beyond any end.
        outside = (at.view(np.uint64) >= _NODES).any(axis=2) | (reach == len(SPEEDS_MPS))
        if np.count_nonzero(outside):
            at[outside], reach[outside] = 0, 0
        place = slots[:, None], at[..., 1], at[..., 0], reach
        found = self._planes[place]
        absent = np.isnan(found[..., 3])
        if np.count_nonzero(absent):
            self._make(np.broadcast_to(slots[:, None], absent.shape)[absent], at[absent], reach[absent])
            found = self._planes[place]
        found = found.astype(float)
        found[outside, 3] = np.inf
        return FootPlanes(found[..., :3], first + at * NODE_M, found[..., 3])

    def _slots(self, rows: list[tuple[int, int, int]]) -> np.ndarray:
        """Return the slots (n,) of tiles, which are looked at if they are new."""
        unique = dict.fromkeys(rows)
        for row in unique:
            if row in self._slot:
                self._slot.move_to_end(row)
                continue
            if len(self._slot) < max(_KEPT, len(unique)):
                slot = len(self._slot)
                if slot == len(self._first):
                    self._grow(max(slot, 4))
            else:
                slot = self._slot.popitem(last=False)[1]
            self._slot[row] = slot
            self._look_at(slot, row)
        return np.array([self._slot[row] for row in rows], dtype=int)

    def _grow(self, count: int) -> None:
        """Make room for so many slots more."""
        for name in ("_planes", "_first", "_floor", "_roof"):
            old: np.ndarray = getattr(self, name)
            setattr(self, name, np.concatenate([old, np.zeros((count, *old.shape[1:]), old.dtype)]))

    def _look_at(self, slot: int, row: tuple[int, int, int]) -> None:
        """Fill a slot with a tile's floors and roofs: those between which what lies over a node's floor may be."""
        first, bottom = np.array(row[:2]) * TILE_M - _AROUND_M, row[2] * _SLAB_M
        low, high = (side - bottom for side in self._grid(row[:2], first))
        about = (low < _SLAB_M + _ASIDE_M + _LEDGE_M) & (high > _LEDGE_M - _ASIDE_M)
        count = about.sum(axis=2)
        for side, several, found in ((low, _SEVERAL_M, self._floor), (high, np.inf, self._roof)):
            one = np.where(about, side, 0).sum(axis=2)
            found[slot] = np.where(count == 1, one, np.where(count == 0, np.nan, several))
        self._planes[slot], self._first[slot] = np.nan, [*first, bottom]

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

    def _make(self, slots: np.ndarray, nodes: np.ndarray, reaches: np.ndarray) -> None:
        """Make the planes of nodes (m, 2), column and row, of the tiles in slots (m,), with reaches (m,) by number.

        Where they are few, those of the nodes in squares about them are made too.
        """
        side = max(1, math.isqrt(_TOGETHER // len(slots)))
        begun = np.column_stack([slots, reaches, nodes // side * side])
        begun = np.array(list(dict.fromkeys(map(tuple, begun.tolist()))))
        own = np.array(list(np.ndindex(side, side)))
        each = (begun[:, None, 2:] + own).reshape(-1, 2)
        slots, reaches = begun[:, :2].repeat(len(own), axis=0).T
        inside = (each < _NODES).all(axis=1)
        for number in range(len(REACHES_M)):
            those = inside & (reaches == number)
            if those.any():
                slot, node = slots[those], each[those]
                self._planes[slot, node[:, 1], node[:, 0], number] = self._fit(slot, node, number)

    def _fit(self, slots: np.ndarray, nodes: np.ndarray, reach: int) -> np.ndarray:
        """Return slopes, height and error (m, 4) of the floor within a reach of nodes (m, 2) of tiles in slots (m,).

        What is rock at `_LEDGE_M` over the node's floor is left out: the chassis stops there.
        """
        disc, here = _DISCS[reach], (slots * _WIDTH + nodes[:, 1] + _RIM) * _WIDTH + nodes[:, 0] + _RIM
        floor, around = self._floor.take(here), here[:, None] + disc[:, 1] * _WIDTH + disc[:, 0]
        found = np.zeros((len(nodes), 4))
        found[:, 3] = np.inf
        good = np.flatnonzero((floor > -_ASIDE_M) & (floor < _SLAB_M + _ASIDE_M))
        floor, low = floor[good, None].astype(float), self._floor.take(around[good])
        is_free = (low <= floor + _LEDGE_M) & (floor + _LEDGE_M < self._roof.take(around[good]))
        enough = np.count_nonzero(is_free, axis=1) >= _LEAST
        good, floor, low, is_free = good[enough], floor[enough], low[enough], is_free[enough]
        found[good] = fit_planes(disc * NODE_M, np.where(is_free, low - floor, 0.0), is_free)
        first = self._first[slots[good]]
        found[good, 2] += floor[:, 0] + first[:, 2]
        places = first[:, :2] + nodes[good] * NODE_M
        off = self._creases.farthest_m(places, found[good, :3], floor[:, 0] + first[:, 2], REACHES_M[reach], _LEDGE_M)
        found[good, 3] = np.maximum(found[good, 3], off)
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
