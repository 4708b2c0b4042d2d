"""The drift network: the skeleton of the free space as a graph of legs, junctions and dead ends."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable

import networkx as nx
import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.errors import GeometryError
from pipeline.geometry.polyline import arc_length
from pipeline.geometry.thinning import thin_polygon
from pipeline.types import DriftNetwork, Frame, Leg

Pixel = tuple[int, int]

_REFINEMENTS = 3

_SMOOTHING_CELLS = 3.0  # a skeleton walks in king's moves; unsmoothed its length is up to 8 % too long


def trace_network(free: Polygon, cell_m: float, min_leg_m: float, station_spacing_m: float) -> DriftNetwork:
    """Trace the drift network of a free-space polygon.

    Parameters
    ----------
    free : shapely.Polygon, m, mine frame
    cell_m : float
        Cell of the grid that is thinned. It is halved, up to three times, until the skeleton has one loop for each
        island and hangs together, as the polygon does.
    min_leg_m : float
        A dead-end leg counts when it reaches this far beyond the walls of the drift it leaves.
    station_spacing_m : float
        Distance between the stations reported along a leg.

    Returns
    -------
    DriftNetwork
        `loops` is the graph's cycle rank; it equals the number of islands.

    Raises
    ------
    GeometryError
        If a passage or a pillar is too thin even for the finest cells.
    """
    for finer in range(_REFINEMENTS + 1):
        pixels, frame = thin_polygon(free, cell_m / 2**finer)
        parts = nx.number_connected_components(pixels)
        loops = pixels.number_of_edges() - pixels.number_of_nodes() + parts
        if (loops, parts) == (len(free.interiors), 1):
            break
    else:
        raise GeometryError(
            f"skeleton: {len(free.interiors)} islands in one part, but {loops} loops in {parts} parts at cells of "
            f"{1 / frame.px_per_m:.3g} m; some passage or pillar is thinner"
        )
    graph = _contract(pixels, frame)
    boundary = free.boundary
    shapely.prepare(boundary)
    _prune_spurs(graph, boundary, min_leg_m)
    return _describe(graph, boundary, station_spacing_m, 1 / frame.px_per_m)


def trace_alike(
    outlines: list[Polygon], cell_m: float, min_leg_m: float, station_spacing_m: float
) -> list[DriftNetwork]:
    """Trace several outlines in cells of one size, the finest that any of them needs, so that they can be compared."""
    networks = [trace_network(outline, cell_m, min_leg_m, station_spacing_m) for outline in outlines]
    finest = min(network.cell_m for network in networks)
    return [
        network if network.cell_m == finest else trace_network(outline, finest, min_leg_m, station_spacing_m)
        for network, outline in zip(networks, outlines, strict=True)
    ]


def _contract(pixels: nx.Graph, frame: Frame) -> nx.MultiGraph:
    """Contract pixel chains to legs: nodes carry `xy` (m), edges their `path` ((n, 2) m, from the lower node id)."""
    junctions = pixels.subgraph([p for p, degree in pixels.degree if degree > 2])
    owner: dict[Pixel, int] = {}
    graph: nx.MultiGraph = nx.MultiGraph()

    def centre(cells: Iterable[Pixel]) -> np.ndarray:
        rc = np.array(sorted(cells), dtype=float)
        return frame.to_mine(rc[:, ::-1] + 0.5).mean(axis=0)

    def add_node(cells: Collection[Pixel]) -> None:
        owner.update(dict.fromkeys(cells, len(graph)))
        graph.add_node(len(graph), xy=centre(cells))

    for cluster in sorted(nx.connected_components(junctions), key=min):
        add_node(cluster)
    for pixel, degree in pixels.degree:
        if degree <= 1:
            add_node([pixel])
    for component in sorted(nx.connected_components(pixels), key=min):
        if not any(pixel in owner for pixel in component):  # a ring without a junction still needs a node
            add_node([min(component)])

    chains = pixels.subgraph([p for p in pixels if p not in owner])
    for chain in sorted(nx.connected_components(chains), key=min):
        sub = pixels.subgraph(chain)
        ends = [p for p in sorted(chain) if sub.degree(p) < 2]
        order = list(nx.dfs_preorder_nodes(sub, ends[0])) if ends else []
        doors = [sorted(owner[q] for q in pixels[p] if q in owner) for p in (order[0], order[-1])]
        first, last = (doors[0][0], doors[0][-1]) if len(order) == 1 else (doors[0][0], doors[1][0])
        points = frame.to_mine(np.array(order, dtype=float)[:, ::-1] + 0.5)
        _add_leg(graph, first, last, np.vstack([graph.nodes[first]["xy"], points, graph.nodes[last]["xy"]]))
    for p, q in pixels.edges:
        if p in owner and q in owner and owner[p] != owner[q]:
            _add_leg(graph, owner[p], owner[q], np.array([graph.nodes[owner[p]]["xy"], graph.nodes[owner[q]]["xy"]]))
    return graph


def _add_leg(graph: nx.MultiGraph, first: int, last: int, path: np.ndarray) -> None:
    if first > last:
        first, last, path = last, first, path[::-1]
    smooth = gaussian_filter1d(path, _SMOOTHING_CELLS, axis=0, mode="nearest") if len(path) > 2 else path.copy()
    smooth[0], smooth[-1] = path[0], path[-1]
    length = float(np.linalg.norm(np.diff(smooth, axis=0), axis=1).sum())
    graph.add_edge(first, last, path=smooth, length=length)


def _prune_spurs(graph: nx.MultiGraph, boundary: BaseGeometry, min_leg_m: float) -> None:
    """Drop dead-end legs that hardly leave the drift they start in, shortest first, and join what they split."""
    while True:
        spurs = []
        for end in [n for n in graph if graph.degree(n) == 1]:
            ((_, root, key, leg),) = graph.edges(end, keys=True, data=True)
            reach = leg["length"] - boundary.distance(shapely.Point(graph.nodes[root]["xy"]))
            if graph.degree(root) > 2 and reach < min_leg_m:
                spurs.append((leg["length"], end, root, key))
        if not spurs:
            return
        _, end, root, key = min(spurs)
        graph.remove_node(end)
        if graph.degree(root) == 2:
            _join_through(graph, root)


def _join_through(graph: nx.MultiGraph, node: int) -> None:
    """Replace a node of degree two by one leg."""
    legs = list(graph.edges(node, keys=True, data=True))
    if len(legs) < 2:  # a loop that starts and ends here keeps its node
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


def _describe(graph: nx.MultiGraph, boundary: BaseGeometry, spacing_m: float, cell_m: float) -> DriftNetwork:
    order = sorted(graph, key=lambda n: tuple(np.round(graph.nodes[n]["xy"], 3)))
    dead = [n for n in order if graph.degree(n) == 1]
    names = {n: f"E{i:02d}" for i, n in enumerate(dead)}
    names |= {n: f"J{i:02d}" for i, n in enumerate(n for n in order if n not in names)}
    rank = {n: i for i, n in enumerate(order)}
    edges = sorted(
        graph.edges(data=True), key=lambda e: (*sorted((rank[e[0]], rank[e[1]])), e[2]["length"], *e[2]["path"][1])
    )
    legs = [_leg(f"L{i:02d}", names, edge, boundary, spacing_m) for i, edge in enumerate(edges)]
    route, line = _main_drift(graph)
    return DriftNetwork(
        nodes_m={names[n]: (_cm(graph.nodes[n]["xy"][0]), _cm(graph.nodes[n]["xy"][1])) for n in order},
        legs=legs,
        junctions=[names[n] for n in order if graph.degree(n) > 2],
        dead_ends=[names[n] for n in dead],
        loops=graph.number_of_edges() - len(graph) + nx.number_connected_components(graph),
        components=nx.number_connected_components(graph),
        total_length_m=_cm(sum(leg.length_m for leg in legs)),
        main_drift=[names[n] for n in route],
        main_drift_m=[(_cm(x), _cm(y)) for x, y in line],
        main_drift_length_m=_cm(np.linalg.norm(np.diff(line, axis=0), axis=1).sum()),
        cell_m=cell_m,
    )


def _cm(value: float) -> float:
    return round(float(value), 2)


def _leg(name: str, names: dict, edge: tuple, boundary: BaseGeometry, spacing_m: float) -> Leg:
    first, last, leg = edge
    chainage, points = resample(leg["path"], spacing_m)
    return Leg(
        name=name,
        start=names[min(first, last)],
        end=names[max(first, last)],
        length_m=_cm(leg["length"]),
        chainage_m=[_cm(c) for c in chainage],
        stations_m=[(_cm(x), _cm(y)) for x, y in points],
        half_width_m=[_cm(boundary.distance(shapely.Point(p))) for p in points],
    )


def resample(path: np.ndarray, spacing_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return chainages (n,) m and points (n, 2) m along a polyline, evenly spaced by about `spacing_m`, ends kept."""
    along = arc_length(path)
    chainage = np.linspace(0.0, along[-1], max(2, round(along[-1] / spacing_m) + 1))
    return chainage, np.column_stack([np.interp(chainage, along, path[:, k]) for k in (0, 1)])


def _main_drift(graph: nx.MultiGraph) -> tuple[list[int], np.ndarray]:
    """Return the longest of the shortest routes between two nodes, from west to east, and its line."""
    best = max(
        (
            (lengths[b], a, b)
            for a, lengths in nx.all_pairs_dijkstra_path_length(graph, weight="length")
            for b in lengths
        ),
        key=lambda item: (round(item[0], 6), -item[1]),
    )
    _, a, b = best
    if graph.nodes[a]["xy"][0] > graph.nodes[b]["xy"][0]:
        a, b = b, a
    route = nx.dijkstra_path(graph, a, b, weight="length")
    if len(route) == 1:  # a lone ring: once round
        return route, next(iter(graph.get_edge_data(a, a).values()))["path"]
    line = [graph.nodes[a]["xy"][None]]
    for p, q in itertools.pairwise(route):
        leg = min(graph.get_edge_data(p, q).values(), key=lambda e: e["length"])
        line.append((leg["path"] if p < q else leg["path"][::-1])[1:])
    return route, np.vstack(line)


def require_same_network(
    traced: DriftNetwork, simplified: DriftNetwork, outline: Polygon, tolerance_m: float, min_leg_m: float
) -> None:
    """Refuse a simplification that changes the drift network: a passage closed, an island opened, a drift lost.

    The two networks must have as many loops and parts, and every traced station must still lie in the simplified
    outline; only within `min_leg_m` of its face, where a dead end has no width left, may a drift recede.

    Raises
    ------
    GeometryError
        Naming the tolerance and what it would change, and where.
    """
    advice = f"contours.tolerance_m = {tolerance_m:g} would change the topology"
    if (traced.loops, traced.components) != (simplified.loops, simplified.components):
        raise GeometryError(
            f"{advice}: {traced.loops} loops in {traced.components} parts become {simplified.loops} in "
            f"{simplified.components}; use a smaller tolerance"
        )
    shapely.prepare(outline)
    faces = np.array([traced.nodes_m[name] for name in traced.dead_ends]).reshape(-1, 2)
    for leg in traced.legs:
        stations = np.array(leg.stations_m)
        near_face = (np.linalg.norm(stations[:, None] - faces, axis=2) <= min_leg_m).any(axis=1)
        closed = ~shapely.contains_xy(outline, stations) & ~near_face
        if closed.any():
            x, y = stations[int(closed.argmax())]
            raise GeometryError(f"{advice}: the drift at ({x:.1f}, {y:.1f}) would be closed; use a smaller tolerance")


def passage_stations(network: DriftNetwork) -> tuple[np.ndarray, np.ndarray]:
    """Return the network's stations (n, 2) and half widths (n,), m, but for those within a dead end's rounded face."""
    ends = np.array([network.nodes_m[name] for name in network.dead_ends]).reshape(-1, 2)
    stations = np.array([p for leg in network.legs for p in leg.stations_m]).reshape(-1, 2)
    half = np.array([w for leg in network.legs for w in leg.half_width_m])
    along = np.ones(len(half), bool) if not len(ends) else cKDTree(ends).query(stations)[0] >= half
    return stations[along], half[along]
