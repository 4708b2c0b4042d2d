"""Contract the pixels of a skeleton into a graph of legs, and remove its spurs."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import gaussian_filter1d

from pipeline.geometry.network.thinning import Skeleton
from pipeline.types import Frame

_SMOOTHING_CELLS = 3.0  # s.d. of the smoothing; pixel chains run in 45 deg steps, which makes them up to 8 % too long


@dataclass(frozen=True, eq=False)
class GraphLeg:
    """A leg: its nodes, the lower number first, the path (n, k) m from that one to the other, and its length, m."""

    first: int
    last: int
    path: np.ndarray
    length_m: float


@dataclass(frozen=True)
class LegGraph:
    """Junctions and ends by number, each with its place (2,) m, mine frame, and its legs: a ring at a node is two."""

    places_m: dict[int, np.ndarray] = field(default_factory=dict)
    legs_at: dict[int, list[GraphLeg]] = field(default_factory=dict)

    @property
    def legs(self) -> list[GraphLeg]:
        """Return each leg once."""
        return list(dict.fromkeys(leg for legs in self.legs_at.values() for leg in legs))

    def add_node(self, number: int, place_m: np.ndarray) -> None:
        """Add a node without legs."""
        self.places_m[number], self.legs_at[number] = place_m, []

    def add_leg(self, first: int, last: int, path: np.ndarray) -> None:
        """Add a leg with a path (n, k) m from one node to another one: x, y, and what else a line has there."""
        if first > last:
            first, last, path = last, first, path[::-1]
        leg = GraphLeg(first, last, path, float(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1).sum()))
        self.legs_at[first].append(leg)
        self.legs_at[last].append(leg)

    def remove_node(self, number: int) -> None:
        """Remove a node and its legs."""
        for leg in self.legs_at.pop(number):
            other = leg.first + leg.last - number
            if other != number:
                self.legs_at[other].remove(leg)
        del self.places_m[number]

    def degree(self, number: int) -> int:
        """Return how many legs end at a node."""
        return len(self.legs_at[number])

    def copy(self) -> LegGraph:
        """Return a graph of the same legs."""
        found = LegGraph(dict(self.places_m), {number: [] for number in self.places_m})
        for leg in self.legs:
            found.legs_at[leg.first].append(leg)
            found.legs_at[leg.last].append(leg)
        return found

    def shortest_route(self, start: int, end: int) -> list[int]:
        """Return the nodes of the shortest way from one node to another; of equals the one found first."""
        before, far_m, waiting, number = {start: start}, {start: 0.0}, [(0.0, 0, start)], itertools.count(1)
        while waiting:
            apart_m, _, node = heapq.heappop(waiting)
            if node == end:
                break
            for leg in self.legs_at[node]:
                other = leg.first + leg.last - node
                if apart_m + leg.length_m < far_m.get(other, np.inf):
                    before[other], far_m[other] = node, apart_m + leg.length_m
                    heapq.heappush(waiting, (far_m[other], next(number), other))
        route = [end]
        while route[-1] != start:
            route.append(before[route[-1]])
        return route[::-1]


def contract_pixels(skeleton: Skeleton, frame: Frame) -> LegGraph:
    """Contract a skeleton's chains of pixels into legs; `frame` is the pixel grid."""
    graph = LegGraph()
    node_of, places = _nodes(skeleton), frame.to_mine(skeleton.pixels[:, ::-1].astype(float) + 0.5)
    for number, pixels in enumerate(_groups(np.flatnonzero(node_of >= 0), node_of)):
        graph.add_node(number, places[pixels].mean(axis=0))
    between = (node_of[skeleton.links] < 0).all(axis=1)
    beside = _two_neighbours(skeleton, node_of < 0)
    for chain in _groups(np.flatnonzero(node_of < 0), skeleton.parts(skeleton.links[between])):
        order = _in_order(chain, beside, node_of)
        nodes = [sorted(number for number in node_of[beside[p]].tolist() if number >= 0) for p in (order[0], order[-1])]
        first, last = (nodes[0][0], nodes[0][-1]) if len(order) == 1 else (nodes[0][0], nodes[1][0])
        if first > last:
            first, last, order = last, first, order[::-1]
        ends = graph.places_m[first], graph.places_m[last]
        graph.add_leg(first, last, _smooth(np.vstack([ends[0], places[order], ends[1]])))
    for first, last in node_of[skeleton.links].tolist():
        if min(first, last) >= 0 and first != last:
            graph.add_leg(first, last, np.array([graph.places_m[first], graph.places_m[last]]))
    return graph


def _nodes(skeleton: Skeleton) -> np.ndarray:
    """Return the number of each pixel's node (n,), -1 on the chains between: of junctions, of ends, of rings."""
    degree = np.bincount(skeleton.links.ravel(), minlength=len(skeleton.pixels))
    crowded, ends = degree > 2, np.flatnonzero(degree <= 1)
    junction = skeleton.parts(skeleton.links[crowded[skeleton.links].all(axis=1)])
    node_of = np.full(len(degree), -1)
    node_of[crowded] = np.unique(junction[crowded], return_inverse=True)[1]
    node_of[ends] = node_of.max(initial=-1) + 1 + np.arange(len(ends))
    part = skeleton.parts(skeleton.links)
    ring = np.setdiff1d(part, part[node_of >= 0])  # a ring without a junction needs one node
    node_of[np.unique(part, return_index=True)[1][ring]] = node_of.max(initial=-1) + 1 + np.arange(len(ring))
    return node_of


def _groups(pixels: np.ndarray, number: np.ndarray) -> list[np.ndarray]:
    """Return the pixels of each number, the lowest number first; pixels keep their order."""
    order = pixels[np.argsort(number[pixels], kind="stable")]
    return np.split(order, np.flatnonzero(np.diff(number[order])) + 1) if len(order) else []


def _two_neighbours(skeleton: Skeleton, which: np.ndarray) -> np.ndarray:
    """Return the neighbours (n, 2) of those pixels that have two; the others' are undefined."""
    both = np.concatenate([skeleton.links, skeleton.links[:, ::-1]])
    both = both[np.isin(both[:, 0], np.flatnonzero(which))]
    both = both[np.argsort(both[:, 0], kind="stable")]
    beside = np.full((len(which), 2), -1)
    beside[both[::2, 0]] = both[:, 1].reshape(-1, 2)
    return beside


def _in_order(chain: np.ndarray, beside: np.ndarray, node_of: np.ndarray) -> np.ndarray:
    """Return the pixels of a chain from the first of its ends to the other."""
    step = dict(zip(chain.tolist(), beside[chain].tolist(), strict=True))
    at = int(chain[(node_of[beside[chain]] >= 0).any(axis=1).argmax()])
    order, before = [at], next(pixel for pixel in step[at] if pixel not in step)
    while len(order) < len(step):
        one, other = step[at]
        before, at = at, other if one == before else one
        order.append(at)
    return np.array(order)


def _smooth(path: np.ndarray) -> np.ndarray:
    """Return a path (n, 2) without the steps of its pixels; its ends stay."""
    smooth: np.ndarray = gaussian_filter1d(path, _SMOOTHING_CELLS, axis=0, mode="nearest")
    smooth[0], smooth[-1] = path[0], path[-1]
    return smooth


def prune_spurs(graph: LegGraph, clearance_m: Mapping[int, float], min_leg_m: float) -> None:
    """Remove dead-end legs that reach less than `min_leg_m` beyond the walls of the drift they leave, shortest first.

    `clearance_m` are the nodes' distances from the walls. The two legs that a removed leg separated become one.
    """

    def spur_at(end: int) -> tuple[float, int, int] | None:
        (leg,) = graph.legs_at[end]
        root = leg.first + leg.last - end
        short = graph.degree(root) > 2 and leg.length_m - clearance_m[root] < min_leg_m
        return (leg.length_m, end, root) if short else None

    spurs = [spur for end in graph.places_m if graph.degree(end) == 1 and (spur := spur_at(end))]
    heapq.heapify(spurs)
    while spurs:
        spur = heapq.heappop(spurs)
        _, end, root = spur
        if end not in graph.places_m or spur_at(end) != spur:  # its leg was joined to another one
            continue
        graph.remove_node(end)
        if graph.degree(root) == 2:
            ends = [leg.first + leg.last - root for leg in graph.legs_at[root]]
            others = [node for node in ends if graph.degree(node) == 1]
            _join_through(graph, root)
            for other in others:
                if graph.degree(other) == 1 and (joined := spur_at(other)):
                    heapq.heappush(spurs, joined)


def _join_through(graph: LegGraph, node: int) -> None:
    """Replace a node of degree two and its two legs by one leg."""
    one, two = graph.legs_at[node]
    if one is two:  # a loop from this node to itself keeps the node
        return
    to_node, from_node = (leg.path if node == leg.last else leg.path[::-1] for leg in (one, two))
    graph.remove_node(node)
    first, last = (leg.first + leg.last - node for leg in (one, two))
    graph.add_leg(first, last, np.vstack([to_node, from_node[::-1][1:]]))
