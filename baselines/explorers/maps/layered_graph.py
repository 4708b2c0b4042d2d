"""The layers of a robot's own map as one graph: each layer's own, linked where two layers show the same place."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import block_diag, coo_matrix, csr_matrix

from baselines.explorers.maps.layers import OWN_M, LayeredMap
from baselines.explorers.maps.map_graph import MapGraph, _crosses_rock, map_graph, worth_driving_to
from baselines.explorers.maps.own_map import OwnMap

LayerCell = tuple[int, int, int]  # column and row of a coverage cell, and the number of its layer

_BETWEEN_M = 0.1  # the least length of a link between two layers
_AHEAD_M = 12.0  # a path is driven so far at most before the next plan, and does not pass over itself on it


@dataclass(frozen=True)
class LayeredGraph(MapGraph):
    """A `MapGraph` over all layers; `own` and `clear_m` are those of the layer that the robot is in.

    Attributes
    ----------
    cells : (n, 3) int
        Column, row, and number of the layer.
    layer : int
        The layer that the robot is in.
    parts : dict
        Each layer's own graph.
    """

    layer: int
    parts: dict[int, MapGraph]

    def in_layer(self, layer: int) -> LayeredGraph | None:
        """Return the graph for a robot in a layer; None if there is nothing in it."""
        if layer not in self.parts:
            return None
        part = self.parts[layer]
        return replace(self, own=part.own, clear_m=part.clear_m, layer=layer)

    def maps(self, nodes: np.ndarray) -> list[OwnMap]:
        """Return the map of the layer that each of some nodes (k,) is in."""
        return [self.parts[layer].own for layer in self.cells[nodes, 2].tolist()]

    def nearest(self, place: np.ndarray) -> int:
        """Return the node of the robot's layer from which a robot at a place (2,) m starts."""
        return int(np.flatnonzero(self.cells[:, 2] == self.layer)[0]) + self.parts[self.layer].nearest(place)

    def path(self, place: np.ndarray, before: np.ndarray, end: int) -> np.ndarray:
        """Return the first metres of the path (k, 2), m, of a robot to a node; see `MapGraph.path`."""
        nodes = [end]
        while before[nodes[-1]] >= 0:
            nodes.append(int(before[nodes[-1]]))
        nodes = nodes[::-1]
        length = np.cumsum(np.linalg.norm(np.diff(self.places[nodes], axis=0), axis=1))
        nodes = nodes[: int(np.searchsorted(length, _AHEAD_M)) + 2]
        inside = self.cells[nodes, 2] == self.layer
        first = int(inside.argmin()) if not inside.all() else len(nodes)
        if first < 2:
            return _spaced(np.vstack([place, self.places[nodes]]))
        chain: np.ndarray = np.full(len(self.cells), -1)
        chain[nodes[1:first]] = nodes[: first - 1]
        here = super().path(place, chain, nodes[first - 1])
        return here if first == len(nodes) else np.vstack([here, _spaced(self.places[nodes[first - 1 :]])[1:]])


def _spaced(corners: np.ndarray, spacing_m: float = 0.4) -> np.ndarray:
    """Return places (k, 2) m along a line, about so far apart."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    at = np.linspace(0.0, along[-1], int(along[-1] / spacing_m) + 2)
    return np.column_stack([np.interp(at, along, corners[:, axis]) for axis in (0, 1)])


class LayerGraphs:
    """Makes the graph of a layered map, layer by layer where the map may have changed."""

    def __init__(self, radius_m: float) -> None:
        """Start without layers."""
        self._radius_m = radius_m
        self._parts: dict[int, MapGraph] = {}

    def forget(self) -> None:
        """Make the graphs of all layers anew next time."""
        self._parts = {}

    def graph(
        self, own: LayeredMap, given_up: list[LayerCell], centre: np.ndarray, reach_m: float
    ) -> LayeredGraph | None:
        """Return the graph, with the frontier that lies within reach of a place (2,) m and was not given up.

        None if there is nothing in any layer.
        """
        near = own.near_robots()
        for layer in [k for k in sorted(own.layers) if k in near or k not in self._parts]:
            mine = own.layers[layer]
            part = OwnMap(mine.cell_m)  # of its own floors: farther away its walls are not whole
            floor = own.has_own_floor(layer)
            part.low, part.fine, part.seen = mine.low, mine.fine, mine.seen & floor
            cells = [(col, row) for col, row, number in given_up if number == layer]
            keep = worth_driving_to(part, cells, centre, reach_m) & floor & ~mine.seen
            rows, cols = np.nonzero(part.frontier() & keep)
            known = own.seen_elsewhere(layer, np.column_stack([cols, rows]) + mine.low)
            keep[rows[known], cols[known]] = False
            self._parts[layer] = map_graph(part, self._radius_m, keep)
        parts = {layer: part for layer, part in sorted(self._parts.items()) if len(part.cells)}
        return _joined(own, parts) if parts else None


def _meet(part: MapGraph, one: np.ndarray, two: np.ndarray) -> bool:
    """Return whether two places (2,) m of one cell have no rock of a layer between them."""
    return not _crosses_rock(part.own, one, two)


def _joined(own: LayeredMap, parts: dict[int, MapGraph]) -> LayeredGraph:
    """Return the graphs of all layers as one, linked where two layers have seen the same cell at the same height."""
    firsts = dict(zip(parts, np.cumsum([0, *(len(part.cells) for part in parts.values())]).tolist(), strict=False))
    first, here = next(iter(parts.items()))
    cells = np.vstack([np.column_stack([p.cells, np.full(len(p.cells), k)]) for k, p in parts.items()])
    places = np.vstack([part.places for part in parts.values()])
    clusters, most = [], 0
    for part in parts.values():
        clusters.append(np.where(part.cluster > 0, part.cluster + most, 0))
        most += int(part.cluster.max(initial=0))
    cluster = np.concatenate(clusters)
    ours, theirs = [], []
    number = {tuple(cell): node for node, cell in enumerate(cells.tolist())}
    for layer, part in parts.items():
        floor = own.layers[layer].floor_of(part.cells)
        for other in (k for k in own.beside(layer) if k > layer and k in parts):
            near = np.abs(own.layers[other].floor_of(part.cells) - floor) < OWN_M
            for node in np.flatnonzero(near & (part.cluster == 0)).tolist():
                twin = number.get((*part.cells[node].tolist(), other), -1)
                if twin >= 0 and cluster[twin] == 0 and _meet(part, places[firsts[layer] + node], places[twin]):
                    ours.append(firsts[layer] + node)
                    theirs.append(twin)
    lengths = np.linalg.norm(places[ours] - places[theirs], axis=1) + _BETWEEN_M
    between = coo_matrix((lengths, (ours, theirs)), shape=(len(cells),) * 2)
    links = csr_matrix(block_diag([part.links for part in parts.values()]) + between)
    return LayeredGraph(cells, places, links, cluster, here.own, here.clear_m, first, parts)
