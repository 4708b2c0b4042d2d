"""The drift network of a survey's legs seen from above."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import networkx as nx
import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.geometry.network.skeleton import trace_network
from pipeline.types import DriftNetwork, Leg, SurveyedLegs, lines_of

_DIGITS = 2
_LEAST_PILLAR_M2 = 0.25  # of a hole in a view from above: smaller ones are no pillars
_THIN_M = 0.05  # half the width below which necks of drifts and of rock are cut in a view from above


def plan_network(surveyed: SurveyedLegs, cell_m: float) -> DriftNetwork:
    """Return the network in plan: junctions and ends are its nodes, the chains of stations between them its legs.

    Half widths are half the distance between both walls. The main drift is the longest of the shortest ways between
    two ends. A ring without a junction begins at its first station. `cell_m` is stated in the network's record.
    """
    stations = lines_of(surveyed.names)
    graph: nx.MultiGraph = nx.MultiGraph()
    place: dict[str, np.ndarray] = {}
    half: dict[str, float] = {}
    walls = np.nan_to_num(surveyed.lrud_m[:, :2]).sum(axis=1) / 2
    for k, name in enumerate(stations):
        place[name], half[name] = surveyed.positions_m[k], max(float(walls[k]), half.get(name, 0.0))
    for begin, end in zip(surveyed.first[:-1].tolist(), surveyed.first[1:].tolist(), strict=True):
        for a, b in zip(stations[begin : end - 1], stations[begin + 1 : end], strict=True):
            graph.add_edge(a, b, length=float(np.linalg.norm(place[a] - place[b])))
    chains = list(_chains(graph))
    ends = list(dict.fromkeys(name for chain in chains for name in (chain[0], chain[-1])))
    ends.sort(key=lambda name: (graph.degree(name) < 3, stations.index(name)))
    names = {name: f"{'J' if graph.degree(name) > 2 else 'E'}{number}" for number, name in enumerate(ends, start=1)}
    legs = [_leg(f"L{number}", chain, names, place, half) for number, chain in enumerate(chains, start=1)]
    main = _main_drift(graph, ends)
    return DriftNetwork(
        nodes_m={names[name]: _plan(place[name]) for name in ends},
        legs=legs,
        junctions=[names[name] for name in ends if graph.degree(name) > 2],
        dead_ends=[names[name] for name in ends if graph.degree(name) == 1],
        loops=graph.number_of_edges() - graph.number_of_nodes() + nx.number_connected_components(graph),
        components=nx.number_connected_components(graph),
        total_length_m=round(sum(leg.length_m for leg in legs), _DIGITS),
        main_drift=[names[name] for name in main if name in names],
        main_drift_m=[_plan(place[name]) for name in main],
        main_drift_length_m=round(_length(place, main), _DIGITS),
        cell_m=cell_m,
    )


def _chains(graph: nx.MultiGraph) -> Iterable[list[str]]:
    """Return the ways between junctions and ends as rows of stations, then the rings."""
    left = set(graph.edges(keys=True))
    starts = [name for name in graph if graph.degree(name) != 2]
    for start in [*starts, *graph]:
        for _, follower, key in list(graph.edges(start, keys=True)):
            if not _take(left, start, follower, key):
                continue
            chain = [start, follower]
            while graph.degree(chain[-1]) == 2 and chain[-1] != start:
                following = [
                    other for _, other, k in graph.edges(chain[-1], keys=True) if _take(left, chain[-1], other, k)
                ]
                if not following:
                    break
                chain += following[:1]
            yield chain


def _take(left: set[tuple[str, str, int]], a: str, b: str, key: int) -> bool:
    """Take an edge out of those that are left; return whether it was among them."""
    for edge in ((a, b, key), (b, a, key)):
        if edge in left:
            left.remove(edge)
            return True
    return False


def _leg(
    name: str, chain: list[str], names: dict[str, str], place: dict[str, np.ndarray], half: dict[str, float]
) -> Leg:
    steps = [float(np.linalg.norm(place[a] - place[b])) for a, b in pairwise(chain)]
    chainage = np.concatenate([[0.0], np.cumsum(steps)]).round(_DIGITS)
    return Leg(
        name=name,
        start=names[chain[0]],
        end=names[chain[-1]],
        length_m=float(chainage[-1]),
        chainage_m=chainage.tolist(),
        stations_m=[_plan(place[station]) for station in chain],
        half_width_m=[round(half[station], _DIGITS) for station in chain],
    )


def _main_drift(graph: nx.MultiGraph, ends: list[str]) -> list[str]:
    """Return the stations of a long way: to the farthest end from the first, and from there to the farthest."""
    one, other = ends[0], ends[0]
    for _ in range(2):
        far = nx.single_source_dijkstra_path_length(graph, other, weight="length")
        one, other = other, max(far, key=lambda name: (far[name], name))
    way: list[str] = nx.dijkstra_path(graph, one, other, weight="length")
    return way


def _length(place: dict[str, np.ndarray], way: list[str]) -> float:
    return sum(float(np.linalg.norm(place[a] - place[b])) for a, b in pairwise(way))


def _plan(place: np.ndarray) -> tuple[float, float]:
    x, y = place[:2].round(_DIGITS).tolist()
    return x, y


def seen_network(
    outline: Polygon | MultiPolygon, cell_m: float, min_leg_m: float, station_spacing_m: float
) -> DriftNetwork:
    """Return the network of the largest piece of a view from above; the others are those of `trace_network`.

    A scan's view has drifts and rock that are thinner than any cell. Necks narrower than 10 cm are cut, and the largest
    piece counts: first of the drifts, then of each pillar and of the rock outside.
    """
    drifts = _thickest(outline)
    drifts = _largest(outline) if drifts.is_empty else drifts
    west, south, east, north = drifts.bounds
    around = shapely.box(west - 1, south - 1, east + 1, north + 1)
    rock = [part for part in shapely.get_parts(around - drifts) if part.area > _LEAST_PILLAR_M2]
    free = _largest(around - shapely.union_all([_thickest(part) for part in rock]))
    return trace_network(free, cell_m, min_leg_m, station_spacing_m)


def _thickest(shape: BaseGeometry) -> BaseGeometry:
    """Return the largest of the pieces into which a shape falls where it is less than 10 cm wide; none if it is so."""
    return _largest(shape.buffer(-_THIN_M)).buffer(_THIN_M)


def _largest(shape: BaseGeometry) -> Polygon:
    return max(shapely.get_parts(shape), key=lambda part: part.area)
