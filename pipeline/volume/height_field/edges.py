"""Which edges of the floors' triangles are joined: each with one other at most, so that storeys stay apart."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.volume.height_field.overlapping_floors import MEET_M, TOUCH_M, SharedFloors
from pipeline.volume.height_field.section_floors import SectionFloors, is_leg
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.union import Solid


class Bond(NamedTuple):
    """What speaks for joining two edges on one line, the weightiest first."""

    is_one_patch: bool  # of both triangles
    is_passed: bool  # a leg of both passes over the line
    is_border_passed: bool  # or elsewhere over the border that the line is of
    in_common: int  # pieces of two patches; 0 within one patch


class Candidate(NamedTuple):
    """Two edges that may be joined: `edge` of a triangle on one side, `other` of one on the other side."""

    bond: Bond
    edge: int
    other: int


def joined_edges(
    places: np.ndarray,
    spots: np.ndarray,
    patch: np.ndarray,
    pieces: list[list[int]],
    shared: SharedFloors,
    floors: SectionFloors,
    ways: LegWays,
) -> Iterator[tuple[int, int]]:
    """Yield the pairs of edges that are joined, each edge once: first those of patches with most pieces in common.

    Where a leg passes over a border its floor goes on, whatever else ends or begins there. Of two other floors that
    part the lower one goes on, and a wall stands under the other. Where two legs pass over one edge the upper one goes
    on: it comes down through the lower passage's roof, and the lower one would rise through the upper one's floor.
    """
    edges: dict[tuple[int, int], list[int]] = defaultdict(list)
    for edge, line in enumerate(zip(spots.ravel().tolist(), np.roll(spots, -1, axis=1).ravel().tolist(), strict=True)):
        edges[line].append(edge)
    several: dict[tuple[int, int], list[Candidate]] = {}  # by line
    for (a, b), ours in edges.items():
        tries = []
        for one in ours if a < b else []:
            for two in edges.get((b, a), []):
                p, q = int(patch[one // 3]), int(patch[two // 3])
                in_common = len(set(pieces[p]) & set(pieces[q])) if p != q else 0
                tries.append(Candidate(Bond(p == q, False, False, in_common), one, two))
        if len(tries) == 1 and any(tries[0].bond):
            yield tries[0].edge, tries[0].other
        elif tries:
            several[a, b] = tries
    wanted = [(line, k) for line, tries in several.items() for k in {e // 3 for t in tries for e in (t.edge, t.other)}]
    rows = [(line, k, piece) for line, k in wanted for piece in pieces[patch[k]]]
    middles = places[np.array([line for line, _, _ in rows], int).reshape(-1, 2)].mean(axis=1)
    heights: dict[tuple[tuple[int, int], int], dict[int, float]] = defaultdict(dict)
    found = floors.heights_at(np.array([piece for _, _, piece in rows], int), middles)
    for (line, k, piece), height in zip(rows, found.tolist(), strict=True):
        heights[line, k][piece] = height
    over = ways.over(places, list(several))
    border = _borders([_sides(tries, patch, pieces) for tries in several.values()], list(several))
    by_border: dict[int, set[int]] = defaultdict(set)
    for k, legs in zip(border.tolist(), over, strict=True):
        by_border[k] |= legs
    for (line, tries), k, legs in zip(several.items(), border.tolist(), over, strict=True):
        known = []
        for bond, one, two in tries:
            both = pieces[patch[one // 3]], pieces[patch[two // 3]]
            passed, border_passed = (not bond.is_one_patch and ways.pass_over(*both, by) for by in (legs, by_border[k]))
            bond = bond._replace(is_passed=passed, is_border_passed=border_passed)
            known.append(Candidate(bond, one, two))
        yield from _best(line, known, heights, shared)


def _sides(tries: list[Candidate], patch: np.ndarray, pieces: list[list[int]]) -> frozenset[object]:
    """Return which floors are on both sides of a line, by their pieces."""
    _, *sides = zip(*tries, strict=True)
    return frozenset(frozenset(tuple(pieces[patch[edge // 3]]) for edge in side) for side in sides)


def _borders(sides: list[frozenset[object]], lines: list[tuple[int, int]]) -> np.ndarray:
    """Return the border (n,) that each line between two places is of: lines that meet and part the same floors."""
    first: dict[tuple[int, frozenset[object]], int] = {}
    pairs = [
        (n, first.setdefault((end, side), n))
        for n, (line, side) in enumerate(zip(lines, sides, strict=True))
        for end in line
    ]
    n = len(lines)
    joined = coo_matrix((np.ones(len(pairs)), np.array(pairs, int).reshape(-1, 2).T), (n, n))
    found: np.ndarray = connected_components(joined, directed=False)[1]
    return found


class LegWays:
    """The ways of the legs that are flat enough to drive on, seen from above."""

    def __init__(self, network: SurveyNetwork, pieces: list[Solid]) -> None:
        legs = [k for k, piece in enumerate(pieces) if piece.is_drivable and is_leg(piece)]
        self._legs = np.array(legs, int)
        self._tree = shapely.STRtree(shapely.linestrings(network.ways_m[[pieces[k].shot for k in legs], :, :2]))
        self._goes_on = {k for k in legs if network.joined[pieces[k].shot, 1]}

    def over(self, places: np.ndarray, lines: list[tuple[int, int]]) -> list[set[int]]:
        """Return the legs that pass over each line between two places (p, 2) m."""
        found: list[set[int]] = [set() for _ in lines]
        segments = shapely.linestrings(places[np.array(lines, int).reshape(-1, 2)])
        for line, leg in self._tree.query(segments, predicate="dwithin", distance=TOUCH_M).T.tolist():
            found[line].add(int(self._legs[leg]))
        return found

    def pass_over(self, one: list[int], two: list[int], legs: set[int]) -> bool:
        """Return whether some of the legs pass from one patch to the other; legs that share a section are one way."""
        ours, theirs = legs.intersection(one), legs.intersection(two)
        if not (ours and theirs):
            return False
        follow = {k + 1 for k in ours & self._goes_on} | {k - 1 for k in ours if k - 1 in self._goes_on}
        return not theirs.isdisjoint(ours | follow)


def _best(
    line: tuple[int, int],
    tries: list[Candidate],
    heights: dict[tuple[tuple[int, int], int], dict[int, float]],
    shared: SharedFloors,
) -> Iterator[tuple[int, int]]:
    """Yield the edges of one line that are joined; `heights` are those of the pieces by line and triangle."""
    order = []
    for bond, one, two in tries:
        ours, theirs = heights[line, one // 3], heights[line, two // 3]
        if any(bond) or _follow(ours, theirs, shared):
            mean = sum(ours.values()) / len(ours) + sum(theirs.values()) / len(theirs)
            is_upper_first = bond.is_one_patch or bond.is_passed
            order.append((tuple(-x for x in bond), -mean if is_upper_first else mean, one, two))
    joined: set[int] = set()
    for _, _, one, two in sorted(order):
        if one not in joined and two not in joined:
            joined |= {one, two}
            yield one, two


def _follow(one: dict[int, float], two: dict[int, float], shared: SharedFloors) -> bool:
    """Return whether two of the pieces share a floor, and two are hardly apart in height."""
    near = min(abs(x - y) for x in one.values() for y in two.values()) <= MEET_M
    return near and any(shared.has(i, j) for i in one for j in two)
