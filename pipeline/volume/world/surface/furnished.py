"""Furniture in a volume: along its legs, on its visible rock."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import networkx as nx
import numpy as np

from minexplore.bundle import CELLS, TOPOLOGY
from minexplore.floors.volume_arrays import FloorSpans
from pipeline.geometry.polyline import FloorLine
from pipeline.mjcf.furniture import LEAST_HEIGHT_M, hang_furniture
from pipeline.params.fittings import FurnitureParams
from pipeline.store.codecs import Bundle, decode
from pipeline.volume.union import STEEPEST
from pipeline.volume.world.surface.show import rock_names
from pipeline.volume.world.topology import LegNetwork

_LEFT, _RIGHT, _UP, _DOWN = range(4)


def hang_in_volume(params: FurnitureParams, legs: LegNetwork, rough: Bundle, cells: FloorSpans) -> Bundle:
    """Return the furniture's meshes by name as `.msh`, m, mine frame: see `hang_furniture`.

    It follows the drifts of legs that are flat enough to drive on and at least `LEAST_HEIGHT_M` high. The duct follows
    the longest of them.
    """
    ways = ways_along(legs)
    if not ways:
        return {}
    main = max(ways, key=lambda way: way.length_m)
    return hang_furniture(params, ways, main.floor_m, rough, cells.heights_over)


def hang_again(folder: Path, files: Iterable[str]) -> Callable[[FurnitureParams], Bundle]:
    """Return what makes the furniture of a bundle again, whose record lists these files, on its own rock."""

    def hang(params: FurnitureParams) -> Bundle:
        rough = {name: (folder / name).read_bytes() for name in rock_names(files)}
        return hang_in_volume(params, decode(folder / TOPOLOGY, LegNetwork), rough, decode(folder / CELLS, FloorSpans))

    return hang


def ways_along(legs: LegNetwork) -> list[FloorLine]:
    """Return the drifts between junctions, dead ends, and where they get too steep or too low for furniture."""
    graph: nx.MultiGraph = nx.MultiGraph()
    for number, leg in enumerate(legs.legs):
        high = min(section[_UP] + section[_DOWN] for section in leg.lrud_m) >= LEAST_HEIGHT_M
        if high and leg.grade <= STEEPEST and leg.start != leg.end:
            graph.add_edge(leg.start, leg.end, key=number)
    junctions = set(legs.junctions)
    ends = {node for node, degree in graph.degree() if degree != 2} | (junctions & set(graph))
    ways = []
    for node in [*sorted(ends), *sorted(set(graph) - ends)]:  # those of a ring are left when the others are done
        for _, after, number in sorted(graph.edges(node, keys=True), key=lambda edge: edge[2]):
            if graph.has_edge(node, after, number):
                ways.append(_follow(graph, legs, junctions, ends, node, number))
    return ways


def _follow(
    graph: nx.MultiGraph, legs: LegNetwork, junctions: set[str], ends: set[str], start: str, number: int
) -> FloorLine:
    """Return the drift that begins at a station with a leg, and take its legs out of the graph."""
    floors: list[np.ndarray] = []
    ribs: list[tuple[float, float]] = []
    at, following = start, [number]
    while following:
        leg = legs.legs[following[0]]
        sections, after = leg.lrud_m, leg.end
        if leg.end == at:  # it was surveyed against the way: left and right change sides
            sections, after = [(right, left, up, down) for left, right, up, down in reversed(leg.lrud_m)], leg.start
        for station, section in zip((at, after), sections, strict=True):
            floors.append(np.array(legs.stations_m[station]) - np.array([0.0, 0.0, section[_DOWN]]))
            ribs.append((section[_LEFT], section[_RIGHT]))
        graph.remove_edge(at, after, following[0])
        at = after
        following = [] if at in ends else [key for _, _, key in graph.edges(at, keys=True)]
    places, sides = np.array(floors), np.array(ribs)
    new = np.append(True, np.linalg.norm(np.diff(places, axis=0), axis=1) > 1e-9)  # a station that two legs share
    return FloorLine(places[new], sides[new, 0], sides[new, 1], (start in junctions, at in junctions))
