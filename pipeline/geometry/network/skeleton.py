"""The drift network of a free space: legs, junctions and dead ends, traced along the skeleton."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree
from shapely import Polygon

from pipeline.errors import GeometryError
from pipeline.geometry.network.leg_graph import GraphLeg, LegGraph, contract_pixels, prune_spurs
from pipeline.geometry.network.thinning import thin_polygon
from pipeline.geometry.polyline import resample
from pipeline.geometry.wall_distance import distances_to_walls
from pipeline.types import DriftNetwork, Leg

_REFINEMENTS = 3
_ROWS = 256  # of the matrix of distances that are held at a time


def trace_network(free: Polygon, cell_m: float, min_leg_m: float, station_spacing_m: float) -> DriftNetwork:
    """Trace the drift network of a free-space polygon; see `trace_networks`."""
    return trace_networks(free, cell_m, [min_leg_m], station_spacing_m)[0]


def trace_networks(
    free: Polygon, cell_m: float, min_legs_m: Sequence[float], station_spacing_m: float
) -> list[DriftNetwork]:
    """Trace the drift network of a free-space polygon, once for each shortest dead-end leg.

    Parameters
    ----------
    free : shapely.Polygon, m, mine frame
    cell_m : float
        Cell of the grid that is thinned. It is halved, up to three times, until the skeleton is connected and has one
        loop for each island.
    min_legs_m : sequence of float
        A dead-end leg is kept if it reaches this far beyond the walls of the drift that it leaves.
    station_spacing_m : float
        Distance between the stations along a leg.

    Returns
    -------
    list of DriftNetwork
        One for each of `min_legs_m`. `loops` is the graph's cycle rank; it equals the number of islands.

    Raises
    ------
    GeometryError
        If a passage or a pillar is too thin even for the finest cells.
    """
    for halvings in range(_REFINEMENTS + 1):
        skeleton, frame = thin_polygon(free, cell_m / 2**halvings)
        loops, components = skeleton.loops, skeleton.components
        if (loops, components) == (len(free.interiors), 1):
            break
    else:
        raise GeometryError(
            f"skeleton: {len(free.interiors)} islands in one component, but {loops} loops in {components} components "
            f"at cells of {1 / frame.px_per_m:.3g} m; some passage or pillar is thinner"
        )
    graph = contract_pixels(skeleton, frame)
    clearance = distances_to_walls(free, np.array([*graph.places_m.values()]))
    networks = []
    for min_leg_m in min_legs_m:
        kept = graph.copy()
        prune_spurs(kept, dict(zip(graph.places_m, clearance, strict=True)), min_leg_m)
        networks.append(_describe(kept, free, station_spacing_m, 1 / frame.px_per_m))
    return networks


def trace_alike(
    outlines: list[Polygon], cell_m: float, min_leg_m: float, station_spacing_m: float
) -> list[DriftNetwork]:
    """Trace several outlines in cells of the same size, the smallest that one of them needs, for comparison."""
    return [found for (found,) in trace_all_alike(outlines, cell_m, [min_leg_m], station_spacing_m)]


def trace_all_alike(
    outlines: list[Polygon], cell_m: float, min_legs_m: Sequence[float], station_spacing_m: float
) -> list[list[DriftNetwork]]:
    """Trace outlines as `trace_alike`; each has a network for each shortest dead-end leg."""
    networks = [trace_networks(outline, cell_m, min_legs_m, station_spacing_m) for outline in outlines]
    finest = min(network.cell_m for (network, *_) in networks)
    return [
        found if found[0].cell_m == finest else trace_networks(outline, finest, min_legs_m, station_spacing_m)
        for found, outline in zip(networks, outlines, strict=True)
    ]


def _describe(graph: LegGraph, free: Polygon, spacing_m: float, cell_m: float) -> DriftNetwork:
    order = sorted(graph.places_m, key=lambda n: tuple(np.round(graph.places_m[n], 3)))
    dead_ends = [n for n in order if graph.degree(n) == 1]
    names = {n: f"E{i:02d}" for i, n in enumerate(dead_ends)}
    names |= {n: f"J{i:02d}" for i, n in enumerate(n for n in order if n not in names)}
    rank = {n: i for i, n in enumerate(order)}
    edges = sorted(graph.legs, key=lambda e: (*sorted((rank[e.first], rank[e.last])), e.length_m, *e.path[1]))
    sampled = [resample(leg.path, spacing_m) for leg in edges]
    half_width = distances_to_walls(free, np.concatenate([points for _, points in sampled]))
    ends = np.cumsum([len(points) for _, points in sampled])
    legs = [
        _leg(f"L{i:02d}", names, edge, chainage, points, half)
        for i, (edge, (chainage, points), half) in enumerate(
            zip(edges, sampled, np.split(half_width, ends[:-1]), strict=True)
        )
    ]
    route, line = main_drift(graph)
    components = int(connected_components(_links(graph), directed=False)[0])
    return DriftNetwork(
        nodes_m={names[n]: (_cm(graph.places_m[n][0]), _cm(graph.places_m[n][1])) for n in order},
        legs=legs,
        junctions=[names[n] for n in order if graph.degree(n) > 2],
        dead_ends=[names[n] for n in dead_ends],
        loops=len(edges) - len(order) + components,
        components=components,
        total_length_m=_cm(sum(leg.length_m for leg in legs)),
        main_drift=[names[n] for n in route],
        main_drift_m=[(_cm(x), _cm(y)) for x, y in line],
        main_drift_length_m=_cm(np.linalg.norm(np.diff(line, axis=0), axis=1).sum()),
        cell_m=cell_m,
    )


def _cm(value: float) -> float:
    return round(float(value), 2)


def _leg(
    name: str, names: dict, leg: GraphLeg, chainage: np.ndarray, points: np.ndarray, half_width: np.ndarray
) -> Leg:
    return Leg(
        name=name,
        start=names[leg.first],
        end=names[leg.last],
        length_m=_cm(leg.length_m),
        chainage_m=[_cm(c) for c in chainage],
        stations_m=[(_cm(x), _cm(y)) for x, y in points],
        half_width_m=[_cm(half) for half in half_width],
    )


def main_drift(graph: LegGraph) -> tuple[list[int], np.ndarray]:
    """Return the longest of the shortest routes between two nodes, from west to east, and its line (n, k) m."""
    a, b = _farthest_pair(graph)
    if graph.places_m[a][0] > graph.places_m[b][0]:
        a, b = b, a
    if a == b:  # a single ring: the route is the whole ring
        return [a], graph.legs_at[a][0].path
    route = graph.shortest_route(a, b)
    line = [graph.places_m[a][None]]
    for p, q in itertools.pairwise(route):
        leg = min((leg for leg in graph.legs_at[p] if leg.first + leg.last == p + q), key=lambda leg: leg.length_m)
        line.append((leg.path if p < q else leg.path[::-1])[1:])
    return route, np.vstack(line)


def _farthest_pair(graph: LegGraph) -> tuple[int, int]:
    """Return the two nodes with the longest shortest route, in micrometres; of equals the lowest numbers."""
    nodes, links = sorted(graph.places_m), _links(graph)
    best, pair = -1.0, (nodes[0], nodes[0])
    for start in range(0, len(nodes), _ROWS):
        apart = np.round(dijkstra(links, directed=False, indices=np.arange(start, min(start + _ROWS, len(nodes)))), 6)
        apart[np.isinf(apart)] = -1.0  # of another component
        row, col = np.unravel_index(int(apart.argmax()), apart.shape)
        if apart[row, col] > best:
            best, pair = float(apart[row, col]), (nodes[start + int(row)], nodes[int(col)])
    return pair


def _links(graph: LegGraph) -> coo_array:
    """Return the lengths, m, of the shortest legs between each two nodes, by their places in the nodes' order."""
    number = {node: k for k, node in enumerate(sorted(graph.places_m))}
    shortest = {
        (number[leg.first], number[leg.last]): leg.length_m
        for leg in sorted(graph.legs, key=lambda leg: -leg.length_m)
        if leg.first != leg.last
    }
    ends = np.array([*shortest], int).reshape(-1, 2)
    return coo_array(([*shortest.values()], ends.T), (len(number), len(number))).tocsr()


def require_same_network(
    traced: DriftNetwork, simplified: DriftNetwork, outline: Polygon, setting: str, min_leg_m: float
) -> None:
    """Refuse a simplification that changes the drift network: a closed passage, an opened island, a lost drift.

    Both networks must have the same numbers of loops and components, and every traced station must lie in the
    simplified outline. Stations within `min_leg_m` of a dead end are exempt: it may become shorter.

    Raises
    ------
    GeometryError
        The message gives the setting (parameter and value), what it would change, and where.
    """
    problem = f"{setting} would change the topology"
    if (traced.loops, traced.components) != (simplified.loops, simplified.components):
        raise GeometryError(
            f"{problem}: {traced.loops} loops in {traced.components} components become "
            f"{simplified.loops} in {simplified.components}; use a smaller tolerance"
        )
    shapely.prepare(outline)
    faces = np.array([traced.nodes_m[name] for name in traced.dead_ends]).reshape(-1, 2)
    for leg in traced.legs:
        stations = np.array(leg.stations_m)
        near_face = (np.linalg.norm(stations[:, None] - faces, axis=2) <= min_leg_m).any(axis=1)
        closed = ~shapely.contains_xy(outline, stations) & ~near_face
        if closed.any():
            x, y = stations[int(closed.argmax())]
            raise GeometryError(f"{problem}: the drift at ({x:.1f}, {y:.1f}) would be closed; use a smaller value")


LEAST_HALF_WIDTH_M = 0.35  # narrower passages do not admit the robot


def passage_stations(network: DriftNetwork) -> tuple[np.ndarray, np.ndarray]:
    """Return stations (n, 2) and half widths (n,), m, except stations nearer to a dead end than their half width.

    Of a room, whose stations are all so near, the widest place is returned.
    """
    ends = np.array([network.nodes_m[name] for name in network.dead_ends]).reshape(-1, 2)
    stations = np.array([p for leg in network.legs for p in leg.stations_m]).reshape(-1, 2)
    half = np.array([w for leg in network.legs for w in leg.half_width_m])
    kept = np.ones(len(half), bool) if not len(ends) else cKDTree(ends).query(stations)[0] >= half
    if len(half) and not kept.any():
        kept[half.argmax()] = True
    return stations[kept], half[kept]
