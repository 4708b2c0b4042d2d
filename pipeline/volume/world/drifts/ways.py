"""The drifts of a volume: each a line on the floor through the legs between two junctions or ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import networkx as nx
import numpy as np

from pipeline.geometry.polyline import FloorLine
from pipeline.volume.world.topology import LegNetwork, LegRecord

_LEFT, _RIGHT, _UP, _DOWN = range(4)
_STRAIGHT = np.cos(np.radians(45))  # of a turn that pipe and cable follow from rib to rib


@dataclass(frozen=True)
class Drift:
    """A drift's line on the floor, the stations that it begins and ends at, and the free height (n,) m over it."""

    way: FloorLine
    ends: tuple[str, str]
    headroom_m: np.ndarray

    @property
    def turned(self) -> Drift:
        """Return the drift the other way round."""
        way = self.way
        turned = FloorLine(way.floor_m[::-1], way.right_m[::-1], way.left_m[::-1], way.ends_at_junctions[::-1])
        return Drift(turned, self.ends[::-1], self.headroom_m[::-1])


def drifts_along(legs: LegNetwork, suits: Callable[[LegRecord], bool] = lambda leg: True) -> list[Drift]:
    """Return the drifts of the legs that suit, between junctions, dead ends, and legs that do not."""
    graph: nx.MultiGraph = nx.MultiGraph()
    for number, leg in enumerate(legs.legs):
        if leg.start != leg.end and suits(leg):
            graph.add_edge(leg.start, leg.end, key=number)
    junctions = set(legs.junctions)
    ends = {node for node, degree in graph.degree() if degree != 2} | (junctions & set(graph))
    ways = []
    for node in [*sorted(ends), *sorted(set(graph) - ends)]:  # those of a ring are left when the others are done
        for _, after, number in sorted(graph.edges(node, keys=True), key=lambda edge: edge[2]):
            if graph.has_edge(node, after, number):
                ways.append(_follow(graph, legs, junctions, ends, node, number))
    return ways


def lines_through(drifts: Sequence[Drift]) -> list[FloorLine]:
    """Return lines of drifts that meet at junctions and turn there by 45 deg at most, the straightest first."""
    at: dict[str, list[tuple[int, int]]] = {}
    for number, drift in enumerate(drifts):
        for end in (0, 1):
            if drift.way.ends_at_junctions[end]:
                at.setdefault(drift.ends[end], []).append((number, end))
    turns = [(_turn(drifts, one, other), one, other) for ends in at.values() for one, other in combinations(ends, 2)]
    after: dict[tuple[int, int], tuple[int, int]] = {}
    for straight, one, other in sorted(turns, key=lambda turn: (-round(turn[0], 6), turn[1:])):
        if straight >= _STRAIGHT and one not in after and other not in after:
            after[one], after[other] = other, one
    lines, used = [], set[int]()
    free = [(n, end) for n in range(len(drifts)) for end in (0, 1) if (n, end) not in after]
    for number, end in [*free, *((n, 0) for n in range(len(drifts)))]:  # those of a ring come last
        chain: list[FloorLine] = []
        while number not in used:
            used.add(number)
            chain.append((drifts[number].turned if end else drifts[number]).way)
            number, end = after.get((number, 1 - end), (number, end))
        if chain:
            lines.append(_joined(chain))
    return lines


def _turn(drifts: Sequence[Drift], *ends: tuple[int, int]) -> float:
    """Return the cosine of the angle by which a line turns that comes from one end of a drift and goes to another."""
    ways = []
    for number, end in ends:
        floor = drifts[number].way.floor_m[:: -1 if end else 1, :2]
        away = floor[1:] - floor[0]
        ways.append(away[np.linalg.norm(away, axis=1).argmax()] if not away[0].any() else away[0])
    one, other = (way / max(float(np.linalg.norm(way)), 1e-9) for way in ways)
    return -float(one @ other)


def _joined(chain: Sequence[FloorLine]) -> FloorLine:
    """Return lines that follow each other as one; where they meet, the first one has the floor and the ribs."""
    first, *others = chain
    rows = [np.column_stack([first.floor_m, first.left_m, first.right_m])]
    rows += [np.column_stack([line.floor_m, line.left_m, line.right_m])[1:] for line in others]
    found = np.concatenate(rows)
    return FloorLine(
        found[:, :3], found[:, 3], found[:, 4], (first.ends_at_junctions[0], chain[-1].ends_at_junctions[1])
    )


def _follow(
    graph: nx.MultiGraph, legs: LegNetwork, junctions: set[str], ends: set[str], start: str, number: int
) -> Drift:
    """Return the drift that begins at a station with a leg, and take its legs out of the graph."""
    floors: list[np.ndarray] = []
    ribs: list[tuple[float, float, float]] = []
    at, following = start, [number]
    while following:
        leg = legs.legs[following[0]]
        sections, after = leg.lrud_m, leg.end
        if leg.end == at:  # it was surveyed against the way: left and right change sides
            sections, after = [(right, left, up, down) for left, right, up, down in reversed(leg.lrud_m)], leg.start
        for station, section in zip((at, after), sections, strict=True):
            floors.append(np.array(legs.stations_m[station]) - np.array([0.0, 0.0, section[_DOWN]]))
            ribs.append((section[_LEFT], section[_RIGHT], section[_UP] + section[_DOWN]))
        graph.remove_edge(at, after, following[0])
        at = after
        following = [] if at in ends else [key for _, _, key in graph.edges(at, keys=True)]
    places, sides = np.array(floors), np.array(ribs)
    new = np.append(True, np.linalg.norm(np.diff(places, axis=0), axis=1) > 1e-9)  # a station that two legs share
    way = FloorLine(places[new], sides[new, 0], sides[new, 1], (start in junctions, at in junctions))
    return Drift(way, (start, at), sides[new, 2])
