"""The shortest ways over the places of a world that a robot can stand at: along drifts, in plan or over floors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from minexplore.physics.robot_kind import Robot
from minexplore.sensing.coverage import connected_cells
from minexplore.world import World

_RING = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))  # columns and rows to neighbours
_HALVED = 2  # times that angles between ways are: by 32 ways, the shortest is at most 1.4 % longer than a straight one
_AROUND = np.array([(column, row) for column in (-1, 0, 1) for row in (-1, 0, 1)])
_BESIDE_M = 1.0  # a place higher or lower than this is not beside a robot
_FIRST_M = 16.0  # that a field reaches at first


@dataclass(frozen=True)
class Ways:
    """Straight ways between near places at which a robot can stand, one a cell or, over each other, one a floor.

    Attributes
    ----------
    places_m : (n, 3) float64, m, mine frame
        On the floor; 0 up in a mine that is drawn in plan.
    clearance_m : (n,) float64, m
        To rock.
    keys : (n,) int64
        Of their cells, in order.
    beside : (n, 32) int32
        The place at the end of each way, n where there is none.
    lengths_m : (n, 32) float32, m
    origin_m : (2,) float64, m, mine frame
    cell_m : float
    """

    places_m: np.ndarray
    clearance_m: np.ndarray
    keys: np.ndarray
    beside: np.ndarray
    lengths_m: np.ndarray
    origin_m: np.ndarray
    cell_m: float

    def nearest(self, point_m: np.ndarray) -> tuple[int, float]:
        """Return the place nearest to a point (3,) m, and how far away it is, m."""
        apart = np.linalg.norm(self.places_m - point_m, axis=1)
        number = int(apart.argmin())
        return number, float(apart[number])

    def around(self, point_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the places (k,) in the cells round a point (3,) m, and how far away they are (k,) m."""
        cell = np.floor((point_m[:2] - self.origin_m) / self.cell_m).astype(np.int64) + _AROUND
        key = _keys_of(cell[:, 0], cell[:, 1])
        first, last = self.keys.searchsorted(key), self.keys.searchsorted(key, side="right")
        number = np.concatenate([np.arange(*ends) for ends in zip(first.tolist(), last.tolist(), strict=True)])
        away = self.places_m[number] - point_m
        beside = np.abs(away[:, 2]) <= _BESIDE_M
        return number[beside], np.linalg.norm(away[beside], axis=1)


class WayField:
    """How far places are from one of them along the shortest ways; it grows as far as it is asked for."""

    def __init__(self, ways: Ways, place: int) -> None:
        """Begin at a place."""
        self.place, self._ways, self._open = place, ways, np.array([place])
        self._found = np.full(len(ways.places_m) + 1, np.inf, np.float32)
        self._found[place], self._found[-1] = 0.0, -1.0  # the last stands for no place, to which nothing is shorter
        self._grown_m = 0.0  # what is no farther is known

    def _grow(self, to_m: float) -> None:
        ways, found = self._ways, self._found
        while len(self._open):
            apart = found[self._open]
            if (nearest := float(apart.min())) > to_m:
                self._grown_m = nearest
                return
            known = apart < nearest + ways.cell_m  # no way is shorter than a cell, so nothing shortens these
            ends, reach = ways.beside[self._open[known]], apart[known, None] + ways.lengths_m[self._open[known]]
            shorter = reach < found[ends]
            np.minimum.at(found, ends[shorter], reach[shorter])
            self._open = np.unique(np.concatenate([self._open[~known], ends[shorter]]))
        self._grown_m = np.inf

    def between(self, near_m: float, far_m: float) -> np.ndarray:
        """Return the places (k,) that are so far away."""
        self._grow(far_m)
        return np.flatnonzero((self._found[:-1] >= near_m) & (self._found[:-1] <= far_m))

    def left_m(self, point_m: np.ndarray) -> float:
        """Return how far a point (3,) m is away, m; infinite where no place is round it."""
        number, apart = self._ways.around(point_m)
        if not len(number):
            return np.inf
        while (self._found[number] > self._grown_m).any() and len(self._open):
            self._grow(max(2 * self._grown_m, _FIRST_M))
        return float((self._found[number] + apart).min())

    def way(self, point_m: np.ndarray) -> np.ndarray:
        """Return the places (k,) of the shortest way from a point (3,) m to where this field begins; none, none."""
        if not np.isfinite(self.left_m(point_m)):
            return np.zeros(0, int)
        number, apart = self._ways.around(point_m)
        passed = [int(number[(self._found[number] + apart).argmin()])]
        while self._found[passed[-1]] > 0:
            ends = self._ways.beside[passed[-1]]
            on = np.where(ends < len(self._ways.places_m), self._found[ends], np.inf)
            passed.append(int(ends[(on + self._ways.lengths_m[passed[-1]]).argmin()]))
        return np.array(passed)


def ways_in(world: World, robot: Robot) -> Ways:
    """Return the ways of a robot in a world from the entrance on.

    Raises
    ------
    ValueError
        If the robot fits nowhere.
    """
    anchor_m = np.array(world.record["spawn"]["anchor_m"])
    if world.volume is not None:
        return _ways_over_floors(world, robot, anchor_m)
    row, column = np.nonzero(connected_cells(world, world.clearance_m >= robot.radius_m, anchor_m))
    keys, count = _keys_of(column, row), len(row)
    order = np.argsort(keys)
    keys, column, row = keys[order], column[order], row[order]
    beside = {}
    for east, north in _RING:
        at = np.minimum(keys.searchsorted(wanted := _keys_of(column + east, row + north)), count - 1)
        beside[east, north] = np.append(np.where(keys[at] == wanted, at, count), count)
    places = np.column_stack([world.origin_m + (np.column_stack([column, row]) + 0.5) * world.cell_m, np.zeros(count)])
    return _joined(places, world.clearance_m[row, column], keys, beside, world.origin_m, world.cell_m)


def _ways_over_floors(world: World, robot: Robot, anchor_m: np.ndarray) -> Ways:
    from minexplore.volume.standing import driven_pairs, standing_spans

    spans = world.volume.spans  # type: ignore[union-attr]
    try:
        standing = np.flatnonzero(standing_spans(spans, robot, anchor_m))
    except ValueError as error:
        raise ValueError(f"{world.folder}: {error}") from error
    standing = standing[np.argsort(_keys_of(spans.column[standing], spans.row[standing]), kind="stable")]
    count = len(standing)
    number = np.full(len(spans.column), count)
    number[standing] = np.arange(count)
    beside = {way: np.full(count + 1, count) for way in _RING}
    pairs = driven_pairs(spans, robot)
    one, other = pairs[(number[pairs] < count).all(axis=1)].T
    for east, north in _RING:
        for start, end in ((one, other), (other, one)):
            along = (spans.column[end] - spans.column[start] == east) & (spans.row[end] - spans.row[start] == north)
            beside[east, north][number[start[along]]] = number[end[along]]
    keys = _keys_of(spans.column[standing], spans.row[standing])
    places, clear_m = spans.roomiest_m[standing], spans.clearance_m[standing]
    return _joined(places, clear_m, keys, beside, spans.origin_m, spans.cell_m)


def _joined(
    places_m: np.ndarray,
    clearance_m: np.ndarray,
    keys: np.ndarray,
    beside: dict[tuple[int, int], np.ndarray],
    origin_m: np.ndarray,
    cell_m: float,
) -> Ways:
    """Return ways to neighbours (n + 1,) by their columns and rows, and the straight ones between these.

    Between two ways lies their sum, where both orders of them lead to the same place.
    """
    ring, count = list(_RING), len(places_m)
    for _ in range(_HALVED):
        for one, other in zip(ring, ring[1:] + ring[:1], strict=True):
            ends = beside[other][beside[one]]
            beside[one[0] + other[0], one[1] + other[1]] = np.where(ends == beside[one][beside[other]], ends, count)
        pairs = zip(ring, ring[1:] + ring[:1], strict=True)
        ring = [way for one, other in pairs for way in (one, (one[0] + other[0], one[1] + other[1]))]
    table = np.stack([beside[way][:-1] for way in ring], axis=1).astype(np.int32)
    lengths = np.broadcast_to(np.hypot(*np.array(ring).T).astype(np.float32) * np.float32(cell_m), table.shape)
    if np.ptp(places_m[:, 2]) > 0:
        up = np.append(places_m[:, 2], 0.0).astype(np.float32)
        lengths = np.hypot(lengths, up[table] - up[:-1, None])
    return Ways(places_m, clearance_m, keys, table, lengths, origin_m, cell_m)


def _keys_of(column: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Return one number for each cell; they are within 2^30 cells of the origin."""
    found: np.ndarray = (column.astype(np.int64) << 32) + row.astype(np.int64)
    return found
