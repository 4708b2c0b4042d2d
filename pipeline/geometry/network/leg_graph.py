"""Contract the pixels of a skeleton into a graph of legs, and remove its spurs."""

from __future__ import annotations

import heapq
from collections.abc import Mapping

import networkx as nx
import numpy as np
from scipy.ndimage import gaussian_filter1d

from pipeline.geometry.network.thinning import Skeleton
from pipeline.types import Frame

_SMOOTHING_CELLS = 3.0  # s.d. of the smoothing; pixel chains run in 45 deg steps, which makes them up to 8 % too long


def contract_pixels(skeleton: Skeleton, frame: Frame) -> nx.MultiGraph:
    """Contract a skeleton's chains of pixels into legs.

    Parameters
    ----------
    skeleton : Skeleton
    frame : Frame
        The pixel grid.

    Returns
    -------
    nx.MultiGraph
        Nodes are junctions and ends with `xy` (2,) m, mine frame. Edges are legs with `path` (n, 2) m, from the node of
        lower number to the other, and `length` m.
    """
    graph: nx.MultiGraph = nx.MultiGraph()
    node_of, places = _nodes(skeleton), frame.to_mine(skeleton.pixels[:, ::-1].astype(float) + 0.5)
    for pixels in _groups(np.flatnonzero(node_of >= 0), node_of):
        graph.add_node(len(graph), xy=places[pixels].mean(axis=0))
    between = (node_of[skeleton.links] < 0).all(axis=1)
    beside = _two_neighbours(skeleton, node_of < 0)
    for chain in _groups(np.flatnonzero(node_of < 0), skeleton.parts(skeleton.links[between])):
        order = _in_order(chain, beside, node_of)
        nodes = [sorted(number for number in node_of[beside[p]].tolist() if number >= 0) for p in (order[0], order[-1])]
        first, last = (nodes[0][0], nodes[0][-1]) if len(order) == 1 else (nodes[0][0], nodes[1][0])
        ends = graph.nodes[first]["xy"], graph.nodes[last]["xy"]
        _add_leg(graph, first, last, np.vstack([ends[0], places[order], ends[1]]))
    for first, last in node_of[skeleton.links].tolist():
        if min(first, last) >= 0 and first != last:
            _add_leg(graph, first, last, np.array([graph.nodes[first]["xy"], graph.nodes[last]["xy"]]))
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


def _add_leg(graph: nx.MultiGraph, first: int, last: int, path: np.ndarray) -> None:
    if first > last:
        first, last, path = last, first, path[::-1]
    smooth = gaussian_filter1d(path, _SMOOTHING_CELLS, axis=0, mode="nearest") if len(path) > 2 else path.copy()
    smooth[0], smooth[-1] = path[0], path[-1]
    length = float(np.linalg.norm(np.diff(smooth, axis=0), axis=1).sum())
    graph.add_edge(first, last, path=smooth, length=length)


def prune_spurs(graph: nx.MultiGraph, clearance_m: Mapping[int, float], min_leg_m: float) -> None:
    """Remove dead-end legs that reach less than `min_leg_m` beyond the walls of the drift they leave, shortest first.

    `clearance_m` are the nodes' distances from the walls. The two legs that a removed leg separated become one.
    """

    def spur_at(end: int) -> tuple[float, int, int, int] | None:
        ((_, root, key, leg),) = graph.edges(end, keys=True, data=True)
        short = graph.degree(root) > 2 and leg["length"] - clearance_m[root] < min_leg_m
        return (leg["length"], end, root, key) if short else None

    spurs = [spur for end in graph if graph.degree(end) == 1 and (spur := spur_at(end))]
    heapq.heapify(spurs)
    while spurs:
        spur = heapq.heappop(spurs)
        _, end, root, _ = spur
        if end not in graph or spur_at(end) != spur:  # its leg was joined to another one
            continue
        graph.remove_node(end)
        if graph.degree(root) == 2:
            others = [node for node in graph.neighbors(root) if graph.degree(node) == 1]
            _join_through(graph, root)
            for other in others:
                if graph.degree(other) == 1 and (joined := spur_at(other)):
                    heapq.heappush(spurs, joined)


def _join_through(graph: nx.MultiGraph, node: int) -> None:
    """Replace a node of degree two and its two legs by one leg."""
    legs = list(graph.edges(node, keys=True, data=True))
    if len(legs) < 2:  # a loop from this node to itself keeps the node
        return
    paths, others = [], []
    for _, other, _, leg in legs:
        paths.append(leg["path"] if node > other else leg["path"][::-1])  # towards the node
        others.append(other)
    graph.remove_node(node)
    first, last = others
    path = np.vstack([paths[0], paths[1][::-1][1:]])
    if first > last:
        first, last, path = last, first, path[::-1]
    graph.add_edge(first, last, path=path, length=float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()))
