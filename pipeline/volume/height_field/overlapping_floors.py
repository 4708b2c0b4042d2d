"""Which floors are one where they overlap seen from above."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.volume.height_field.section_floors import SectionFloors, is_leg
from pipeline.volume.mesh_edges import ranges
from pipeline.volume.network import WITHIN_M, SurveyNetwork
from pipeline.volume.union import STEEPEST, Solid

TOUCH_M = 0.003  # seen from above: outlines so near have an edge in common
MEET_M = 0.51  # of floors that meet: somewhere they are no farther apart in height; figures count ledges of up to 0.5 m
APART_M = 2.0  # of floors over each other: what is farther apart is two floors
_NEARLY_M = 0.6  # of two floors that do not meet: as built they might, if they were not held as stated
_PARTS_M = 0.1  # beyond that height, somewhere: floors that part by less are one floor all over
_WAYS_APART_M = 1.5  # of ways that leave one station: what is nearer is one floor, though rock may be between
_RIM_M = 1.0  # between corners on the rim of an overlap
_LEAST_M2 = 1e-6  # of an overlap that has an inside
_NEAR_M = 1.0  # between two overlaps that follow each other: ways that part may have rock between for a short way
_LEAST_DROP_M = 0.007  # of a leg that comes down to another
_SETTLED_M = 1e-4
_ON_RAMP = np.linspace(-1, 1, 17)  # of its length: places where two floors are asked to be one


@dataclass(frozen=True)
class Descents:
    """Where the floors of legs come down to those of others that they meet, seen from above.

    Ways of legs that share a floor have one height where they cross or meet: that of the lowest. From there each rises
    to its own floor as steeply as robots drive.

    Attributes
    ----------
    legs, others : (n,) int64
        The legs that come down, in ascending order, and those that they come down to.
    places : (n, 2) float64, m
    over_m : (n,) float64
        How far the survey's floor of the leg is over the floor at each place.
    """

    legs: np.ndarray
    others: np.ndarray
    places: np.ndarray
    over_m: np.ndarray

    def under(self, legs: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how far (k,) m floors are under the survey's of legs (k,) at places (k, 2) m on their ways.

        The second are the legs (k,) that they come down to, -1 where they do not.
        """
        row, entry = ranges(*(np.searchsorted(self.legs, legs, side) for side in ("left", "right")))
        drop = self.over_m[entry] - STEEPEST * np.linalg.norm(places[row] - self.places[entry], axis=1)
        order = np.argsort(drop, kind="stable")
        order = order[drop[order] > 0]
        found, other = np.zeros(len(legs)), np.full(len(legs), -1)
        found[row[order]], other[row[order]] = drop[order], self.others[entry[order]]  # the largest is last
        return found, other

    def some(self, chosen: np.ndarray) -> Descents:
        """Return those that are chosen."""
        return Descents(self.legs[chosen], self.others[chosen], self.places[chosen], self.over_m[chosen])


class SharedFloors:
    """The pairs of pieces that have one floor where they overlap.

    Where two ways leave a station, or run beside each other, the overlaps of their pieces follow each other. All pairs
    of such a run share a floor if somewhere in it two floors are hardly apart in height. So no floor ends where two
    ways part slowly. Where rock is between the two, they are two floors all the same: if they are farther apart than
    the lower passage is high, and than `_WAYS_APART_M`, or `MEET_M` where no station joins the run, and of two legs
    that cross and share no station: there the survey states two floors. Two that are nowhere more than 10 cm beyond
    that are one all over: where they were two for a few centimetres, the floor had a slot, and a step on both sides.
    """

    def __init__(self, network: SurveyNetwork, pieces: list[Solid], floors: SectionFloors) -> None:
        """Find the pairs among the pieces that are flat enough to drive on."""
        drivable = np.flatnonzero([piece.is_drivable for piece in pieces])
        outlines = floors.outlines
        tree = shapely.STRtree(outlines[drivable])
        one, two = drivable[tree.query(outlines[drivable], predicate="dwithin", distance=TOUCH_M)]
        one, two = one[one < two], two[one < two]
        overlap = shapely.intersection(shapely.buffer(outlines[one], TOUCH_M), outlines[two])
        places, row = shapely.get_coordinates(overlap, return_index=True)
        apart = floors.heights_at(one[row], places) - floors.heights_at(two[row], places)
        low, high = np.full(len(one), np.inf), np.full(len(one), -np.inf)
        np.minimum.at(low, row, apart)
        np.maximum.at(high, row, apart)
        least = np.where(low * high <= 0, 0.0, np.minimum(np.abs(low), np.abs(high)))
        pairs = list(zip(one.tolist(), two.tolist(), strict=True))
        stations = stations_of(network, pieces)
        follow = np.array(list(_following(pairs, overlap, least < MEET_M, stations)), int).reshape(-1, 2)
        n = len(pairs)
        count, run = connected_components(coo_matrix((np.ones(len(follow)), follow.T), (n, n)), directed=False)
        nearest = np.full(count, np.inf)
        np.minimum.at(nearest, run, least)
        self._floors = floors
        apart = np.array([stations[a].isdisjoint(stations[b]) for a, b in pairs], bool)
        parted = np.full(count, MEET_M)
        parted[run[~apart]] = _WAYS_APART_M
        parted_m = np.where(apart & _cross(network, pieces, pairs), MEET_M, parted[run])
        self._parted_m = dict(zip(pairs, parted_m.tolist(), strict=True))
        over = np.maximum(self._over(one[row], two[row], places), self._over(two[row], one[row], places))
        most = np.full(len(one), -np.inf)
        np.maximum.at(most, row, over)
        parted_m[most < _PARTS_M] = np.inf
        self._parted_m = dict(zip(pairs, parted_m.tolist(), strict=True))
        self._pairs = {pair for pair, meets in zip(pairs, nearest[run] < MEET_M, strict=True) if meets}
        self._nearly = {pair for pair, far in zip(pairs, least.tolist(), strict=True) if far < _NEARLY_M} - self._pairs
        self.descents = _descents(network, pieces, floors, self)

    def pairs(self) -> list[tuple[int, int]]:
        """Return the pairs of pieces that share a floor, in ascending order."""
        return sorted(self._pairs)

    def has(self, one: int, two: int) -> bool:
        """Return whether two pieces share a floor where they are not far apart in height."""
        return (min(one, two), max(one, two)) in self._pairs

    def nearly(self, one: int, two: int) -> bool:
        """Return whether two pieces that share no floor state floors that hardly do not meet."""
        return (min(one, two), max(one, two)) in self._nearly

    def borders(self) -> Iterator[tuple[int, shapely.Geometry]]:
        """Yield a piece and the lines where its floor and one that it shares it with begin to be two, seen from above.

        Heights are taken at the corners of a triangulation of the overlap, no farther apart on its rim than a metre.
        """
        pairs = np.array(self.pairs(), int).reshape(-1, 2)
        overlap = shapely.intersection(*self._floors.outlines[pairs.T])
        parts, row = shapely.get_parts(shapely.segmentize(overlap, _RIM_M), return_index=True)
        some = shapely.area(parts) > _LEAST_M2
        triangles, part = shapely.get_parts(shapely.constrained_delaunay_triangles(parts[some]), return_index=True)
        pair = pairs[row[some][part]]
        places = shapely.get_coordinates(shapely.get_exterior_ring(triangles)).reshape(-1, 4, 2)
        for upper, lower in (pair.T, pair.T[::-1]):
            over = self._over(np.repeat(upper, 4), np.repeat(lower, 4), places.reshape(-1, 2)).reshape(-1, 4)
            start, end = over[:, :3], over[:, 1:]
            triangle, edge = np.nonzero((start > 0) != (end > 0))  # two of a triangle's edges, or none
            begin, end = start[triangle, edge], end[triangle, edge]
            share = (begin / (begin - end))[:, None]
            spots = (1 - share) * places[triangle, edge] + share * places[triangle, edge + 1]
            yield from zip(pair[triangle[::2], 0].tolist(), shapely.linestrings(spots.reshape(-1, 2, 2)), strict=True)

    def is_one(self, one: np.ndarray, two: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return which pairs (n,) of pieces that share a floor somewhere do so at places (n, 2) m."""
        found: np.ndarray = np.maximum(self._over(one, two, places), self._over(two, one, places)) < 0
        return found

    def _over(self, upper: np.ndarray, lower: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return how far (n,) m upper floors are beyond the height up to which they are one with lower ones."""
        height = self._floors.heights_at(upper, places) - self._floors.heights_at(lower, places)
        pairs = zip(np.minimum(upper, lower).tolist(), np.maximum(upper, lower).tolist(), strict=True)
        parted_m = np.fromiter(map(self._parted_m.__getitem__, pairs), float, len(upper))
        found: np.ndarray = height - np.maximum(np.minimum(self._floors.tall_at(lower, places), APART_M), parted_m)
        return found


def _cross(network: SurveyNetwork, pieces: list[Solid], pairs: list[tuple[int, int]]) -> np.ndarray:
    """Return which pairs of pieces (n,) are legs that cross, seen from above."""
    both = np.array(pairs, int).reshape(-1, 2)
    lines = shapely.linestrings(network.ways_m[[piece.shot for piece in pieces]][:, :, :2])
    of_legs = np.array([is_leg(piece) for piece in pieces])[both].all(axis=1)
    found: np.ndarray = of_legs & shapely.dwithin(*lines[both.T], TOUCH_M)
    return found


def _descents(network: SurveyNetwork, pieces: list[Solid], floors: SectionFloors, shared: SharedFloors) -> Descents:
    """Return where the legs among the pairs that share a floor come down to each other.

    Two that are two floors over each other on the ramp do not: it would break through the lower one's roof.
    """
    pairs = np.array([pair for pair in shared.pairs() if all(is_leg(pieces[k]) for k in pair)], int).reshape(-1, 2)
    ways = network.ways_m[[piece.shot for piece in pieces]]
    lines = shapely.linestrings(ways[:, :, :2])
    pairs = pairs[shapely.dwithin(*lines[pairs.T], 2 * WITHIN_M + TOUCH_M)]
    places = shapely.get_coordinates(shapely.shortest_line(*lines[pairs.T])).reshape(-1, 2, 2)
    along = shapely.line_locate_point(lines[pairs], shapely.points(places))
    share = along / np.maximum(shapely.length(lines[pairs]), TOUCH_M)
    height = (1 - share) * ways[pairs, 0, 2] + share * ways[pairs, 1, 2]
    row, upper = np.arange(len(pairs)), height.argmax(axis=1)
    ramp = np.ptp(height, axis=1) / STEEPEST * _ON_RAMP[:, None]
    spots = shapely.line_interpolate_point(lines[pairs[row, upper]], (along[row, upper] + ramp).clip(0))
    one, two = (np.broadcast_to(some, ramp.shape).ravel() for some in pairs.T)
    apart = (
        ~shared.is_one(one, two, shapely.get_coordinates(spots))
        & shapely.intersects(floors.outlines[pairs[row, 1 - upper]], spots).ravel()
    )
    is_one = ~apart.reshape(ramp.shape).any(axis=0)
    pairs, places, height = pairs[is_one], places[is_one].reshape(-1, 2), height[is_one].ravel()
    order = np.argsort(pairs.ravel(), kind="stable")
    twin = np.argsort(order, kind="stable")[order ^ 1]
    legs, others, places, height = pairs.ravel()[order], pairs[:, ::-1].ravel()[order], places[order], height[order]
    over, moves = np.zeros(len(legs)), True
    while moves:  # where a leg comes down, those that it meets do, too
        found = Descents(legs, others, places, height - np.minimum(height - over, (height - over)[twin]))
        before, over = over, found.under(legs, places)[0]
        moves = bool((over - before > _SETTLED_M).any())
    return found.some(found.over_m > _LEAST_DROP_M)


def stations_of(network: SurveyNetwork, pieces: list[Solid]) -> list[set[int]]:
    """Return the stations that each piece has; a prism's is the one that it stands on."""
    found = []
    for piece in pieces:
        ends = network.shots[piece.shot]
        if not is_leg(piece):
            ends = ends[[np.linalg.norm(network.places_m[ends, :2] - piece.floor[:2], axis=1).argmin()]]
        found.append(set(ends.tolist()))
    return found


def _following(
    pairs: list[tuple[int, int]], overlap: np.ndarray, meets: np.ndarray, stations: list[set[int]]
) -> Iterator[tuple[int, int]]:
    """Yield the overlaps that follow each other: of one piece with two that meet or share a station, where they touch.

    `meets` (n,) are the pairs with floors hardly apart. The overlaps of a third floor with two that meet follow each
    other, or a ledge would begin where the floor between the two ends.
    """
    row = {pair: k for k, pair in enumerate(pairs)}
    beside: dict[int, list[int]] = {}
    for one, two in pairs:
        beside.setdefault(one, []).append(two)
        beside.setdefault(two, []).append(one)
    for piece, others in beside.items():
        for n, one in enumerate(others):
            for two in others[:n]:
                both = row.get((min(one, two), max(one, two)))
                if both is not None and (meets[both] or stations[one] & stations[two]):
                    a, b = (row[min(piece, k), max(piece, k)] for k in (one, two))
                    if shapely.dwithin(overlap[a], overlap[b], _NEAR_M):
                        yield a, b
