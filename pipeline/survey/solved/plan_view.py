"""The plan view of a solved survey: legs with distances to their walls, as a flat world needs them."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise
from pathlib import Path

import networkx as nx
import numpy as np

from pipeline.errors import InputError
from pipeline.survey.legs import Chain, SurveyLeg, legs_of_chains
from pipeline.survey.shapes import require_at_most
from pipeline.survey.solved.model import LegFlag, SolvedSurvey

Nodes = list[int]


def plan_legs(path: Path, survey: SolvedSurvey) -> list[SurveyLeg]:
    """Return the legs of a solved survey in plan, with their heights.

    Its passages' cross-sections make the legs; a leg of the centreline that joins two cross-sections of different
    passages joins these. A survey without cross-sections gets its walls from its splays: of those within 45 deg of
    level and of square to the passage, the longest on each side.

    Raises
    ------
    InputError
        If no walls are known, or the legs are not connected. The message names the file and the stations.

    Returns
    -------
    list of SurveyLeg
        m, in the survey's own frame.
    """
    plan = _Plan(survey)
    require_at_most(path, len(plan.places), "stations", "stations or more")
    if survey.passages:
        rows = [(plan.node[p.stations].tolist(), p.lrud_m) for p in survey.passages]
        rows += plan.joints(rows)
    else:
        if not (survey.leg_flags & LegFlag.SPLAY).any():
            raise InputError(f"{path}: no cross-sections and no splays; distances to the walls are needed")
        rows = [(chain, plan.splay_walls(chain)) for chain in plan.chains()]
    heights = {
        plan.names[node]: (float(plan.places[node, 2]), float(w[2]), float(w[3]))
        for nodes, walls in rows
        for node, w in zip(nodes, walls, strict=True)
    }
    chains: list[Chain] = [
        [
            (plan.names[node], (float(plan.places[node, 0]), float(plan.places[node, 1])), (float(w[0]), float(w[1])))
            for node, w in zip(nodes, walls, strict=True)
        ]
        for nodes, walls in rows
    ]
    return legs_of_chains(path, chains, heights)


class _Plan:
    """A survey's stations without duplicates: equated stations are one node."""

    def __init__(self, survey: SolvedSurvey) -> None:
        self.survey = survey
        self.places, self.node = np.unique(survey.positions_m, axis=0, return_inverse=True)
        self.node = self.node.reshape(-1)
        names = dict.fromkeys(range(len(self.places)), "")
        for node, name in zip(self.node.tolist(), survey.names, strict=True):
            names[node] = names[node] or name
        self.names = [name or f"unnamed {node}" for node, name in names.items()]
        ends = self.node[survey.legs[survey.centreline()]] if len(survey.legs) else np.zeros((0, 2), np.int64)
        self.edges = np.unique(np.sort(ends[ends[:, 0] != ends[:, 1]], axis=1), axis=0)

    def joints(self, rows: list[tuple[Nodes, np.ndarray]]) -> list[tuple[Nodes, np.ndarray]]:
        """Return the legs between cross-sections that are no neighbours in a passage."""
        drawn = {frozenset(pair) for nodes, _ in rows for pair in pairwise(nodes)}
        walls = {node: row for nodes, lrud in rows for node, row in zip(nodes, lrud, strict=True)}
        found = []
        for a, b in self.edges.tolist():
            if a in walls and b in walls and frozenset((a, b)) not in drawn:
                sides = np.array([walls[a], walls[b]])
                if np.isfinite(sides[:, :2]).all():
                    found.append(([a, b], sides))
        return found

    def chains(self) -> list[Nodes]:
        """Return the centreline as rows of stations between its junctions and ends."""
        graph: nx.Graph = nx.Graph(self.edges.tolist())
        left = {frozenset(edge) for edge in graph.edges}
        starts = [node for node in graph if graph.degree(node) != 2]
        found = []
        for start in [*starts, *graph]:  # then the rings without a junction
            for follower in list(graph[start]):
                if frozenset((start, follower)) in left:
                    found.append(_walk(graph, start, follower, left))
        return found

    def splay_walls(self, nodes: Nodes) -> np.ndarray:
        """Return the distances left and right (n, 4) m that splays measure across a row of stations, else nan."""
        heading = np.gradient(self.places[nodes, :2], axis=0)
        heading /= np.maximum(np.linalg.norm(heading, axis=1, keepdims=True), 1e-9)
        walls = np.full((len(nodes), 4), np.nan)
        for i, (node, (east, north)) in enumerate(zip(nodes, heading, strict=True)):
            splays = self._splays.get(node)
            if splays is None:
                continue
            along = splays[:, 0] * east + splays[:, 1] * north
            left = splays[:, 1] * east - splays[:, 0] * north
            level = np.abs(splays[:, 2]) <= np.hypot(along, left)
            across = left[level & (np.abs(left) >= np.abs(along))]
            walls[i, 0] = across.max(initial=-1.0, where=across > 0)
            walls[i, 1] = (-across).max(initial=-1.0, where=across < 0)
            walls[i, 2:] = splays[:, 2].max(initial=0.0), (-splays[:, 2]).max(initial=0.0)
        walls[walls < 0] = np.nan
        return walls

    @property
    def _splays(self) -> dict[int, np.ndarray]:
        if not hasattr(self, "_by_node"):
            legs = self.survey.legs[(self.survey.leg_flags & LegFlag.SPLAY) > 0]
            by_node = defaultdict(list)
            for start, end in legs.tolist():
                by_node[int(self.node[start])].append(self.survey.positions_m[end] - self.survey.positions_m[start])
            self._by_node = {node: np.array(steps) for node, steps in by_node.items()}
        return self._by_node


def _walk(graph: nx.Graph, start: int, follower: int, left: set[frozenset[int]]) -> Nodes:
    """Follow the centreline to the next junction or end, and take its edges out of `left`."""
    nodes = [start, follower]
    left.discard(frozenset((start, follower)))
    while graph.degree(nodes[-1]) == 2:
        following = [node for node in graph[nodes[-1]] if frozenset((nodes[-1], node)) in left]
        if not following:
            break
        left.discard(frozenset((nodes[-1], following[0])))
        nodes.append(following[0])
    return nodes
