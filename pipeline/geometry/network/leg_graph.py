"""Contract the pixels of a skeleton into a graph of legs, and remove its spurs."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterable, Mapping

import networkx as nx
import numpy as np
from scipy.ndimage import gaussian_filter1d

from pipeline.types import Frame

Pixel = tuple[int, int]

_SMOOTHING_CELLS = 3.0  # s.d. of the smoothing; pixel chains run in 45 deg steps, which makes them up to 8 % too long


def contract_pixels(pixels: nx.Graph, frame: Frame) -> nx.MultiGraph:
    """Contract a skeleton's chains of pixels into legs.

    Parameters
    ----------
    pixels : nx.Graph
        Skeleton pixels (row, column), connected to their neighbours.
    frame : Frame
        The pixel grid.

    Returns
    -------
    nx.MultiGraph
        Nodes are junctions and ends with `xy` (2,) m, mine frame. Edges are legs with `path` (n, 2) m, from the node of
        lower number to the other, and `length` m.
    """
    # Copies: a view of a part asks of every neighbour again whether it belongs to the part.
    junctions = pixels.subgraph([p for p, degree in pixels.degree if degree > 2]).copy()
    node_of: dict[Pixel, int] = {}
    graph: nx.MultiGraph = nx.MultiGraph()

    def centre(cells: Iterable[Pixel]) -> np.ndarray:
        rc = np.array(sorted(cells), dtype=float)
        return frame.to_mine(rc[:, ::-1] + 0.5).mean(axis=0)

    def add_node(cells: Collection[Pixel]) -> None:
        node_of.update(dict.fromkeys(cells, len(graph)))
        graph.add_node(len(graph), xy=centre(cells))

    for cluster in sorted(nx.connected_components(junctions), key=min):
        add_node(cluster)
    for pixel, degree in pixels.degree:
        if degree <= 1:
            add_node([pixel])
    for component in sorted(nx.connected_components(pixels), key=min):
        if not any(pixel in node_of for pixel in component):  # a ring without a junction needs one node
            add_node([min(component)])

    chains = pixels.subgraph([p for p in pixels if p not in node_of]).copy()
    for chain in sorted(nx.connected_components(chains), key=min):
        ends = [p for p in sorted(chain) if chains.degree(p) < 2]
        order = list(nx.dfs_preorder_nodes(chains, ends[0])) if ends else []
        nodes = [sorted(node_of[q] for q in pixels[p] if q in node_of) for p in (order[0], order[-1])]
        first, last = (nodes[0][0], nodes[0][-1]) if len(order) == 1 else (nodes[0][0], nodes[1][0])
        points = frame.to_mine(np.array(order, dtype=float)[:, ::-1] + 0.5)
        _add_leg(graph, first, last, np.vstack([graph.nodes[first]["xy"], points, graph.nodes[last]["xy"]]))
    for p, q in pixels.edges:
        if p in node_of and q in node_of and node_of[p] != node_of[q]:
            _add_leg(
                graph, node_of[p], node_of[q], np.array([graph.nodes[node_of[p]]["xy"], graph.nodes[node_of[q]]["xy"]])
            )
    return graph


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
