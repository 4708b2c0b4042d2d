"""Distances to walls, roof and floor from a survey's splays, and what stands in for the ones that nobody measured."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import networkx as nx
import numpy as np
from scipy.sparse import lil_matrix
from scipy.sparse.linalg import spsolve

from minesurveys.frames import Source
from minesurveys.solved.model import LegFlag, SolvedSurvey
from pipeline.survey.passages.legs import along_stations, says_enough

_PLUMB_M = 1e-6  # in plan: a shorter leg has no direction there
_JOINT = -1  # no node
_DIFFER_M = 0.01  # distances down that differ by more are listed
Rows = list[tuple[list[int], np.ndarray]]  # rows of nodes, with distances left, right, up, down (n, 4) m, nan: unknown


def splays_by_node(survey: SolvedSurvey, node: np.ndarray) -> dict[int, np.ndarray]:
    """Return the steps (k, 3) m of the splays from each node; `node` gives each station its node."""
    found = defaultdict(list)
    for start, end in survey.legs[(survey.leg_flags & LegFlag.SPLAY) > 0].tolist():
        found[int(node[start])].append(survey.positions_m[end] - survey.positions_m[start])
    return {key: np.array(steps) for key, steps in found.items()}


def heights_of(splays: list[np.ndarray | None]) -> np.ndarray:
    """Return the distances up and down (n, 2) m of stations with splays (k, 3) m, or None; nan if none measures one.

    Of the splays within 45 deg of plumb the longest counts.
    """
    found = np.full((len(splays), 2), np.nan)
    for row, steps in zip(found, splays, strict=True):
        if steps is None:
            continue
        run = np.hypot(steps[:, 0], steps[:, 1])
        for column, rise in enumerate((steps[:, 2], -steps[:, 2])):
            plumb = rise[rise > run]
            if len(plumb):
                row[column] = plumb.max()
    return found


def measured(walls: np.ndarray) -> np.ndarray:
    """Return the distances left, right, up and down (n, 4) m; four zeros stand for a section that nobody measured."""
    return np.where((walls == 0).all(axis=1, keepdims=True), np.nan, walls)


def usual_half_width_m(rows: Rows, of_sides: bool = False) -> float | None:
    """Return half the median width where both sides are known; without any None, or `of_sides` the median side."""
    sides = np.concatenate([np.zeros((0, 2)), *(walls[:, :2] for _, walls in rows)])
    both = sides[np.isfinite(sides).all(axis=1)].sum(axis=1) / 2
    known = sides[np.isfinite(sides)] if of_sides and not len(both) else both
    return float(np.median(known)) if len(known) else None


@dataclass(frozen=True)
class FilledSides:
    """Walls (n, 4) m with both sides of every station, and how each side (n, 2) is known (`Source`)."""

    walls: np.ndarray
    sources: np.ndarray

    def have(self, source: Source) -> int:
        """Return how many stations have a side that is known so."""
        return int((self.sources == source).any(axis=1).sum())


def fill_sides(walls: np.ndarray, half_width_m: float) -> FilledSides:
    """Fill in the sides of walls (n, 4) m, nan where none was measured: those that were measured stay.

    Others are interpolated where half of the row's stations or more have that side, else `half_width_m` (m).
    """
    filled, sources = walls.copy(), np.full((len(walls), 2), Source.MEASURED)
    for k in (0, 1):
        filled[:, k] = along_stations(walls[:, k], half_width_m)
        other = Source.INTERPOLATED if says_enough(walls[:, k]) else Source.ASSUMED
        sources[~np.isfinite(walls[:, k]), k] = other
    return FilledSides(filled, sources)


def agree_on_floors(rows: Rows, places_m: np.ndarray) -> tuple[Rows, list[tuple[int, float, float]]]:
    """Return the rows with one distance down at every node, as legs that meet have one floor.

    Where rows differ, a passage that is not steep there counts before a steep one, then one that goes on through the
    node before one that ends there, then the taller one. Each row keeps its own roof; where it has none, or where its
    floor comes up to that of another passage, it gets that passage's if it is higher. The second result has each node
    where passages that are not plumb differ by more than 1 cm: the node, the distance that is taken, and the one
    farthest from it, m.
    """
    found: dict[int, list[tuple[tuple[bool, int, float, float], bool, np.ndarray]]] = defaultdict(list)
    for nodes, walls in rows:
        step = np.abs(np.diff(places_m[nodes], axis=0))
        run, rise = np.hypot(step[:, 0], step[:, 1]), step[:, 2]
        known = np.nan_to_num(np.column_stack([walls[:, 2] + walls[:, 3], walls[:, 3]])).tolist()
        for k, (node, (tall, down)) in enumerate(zip(nodes, known, strict=True)):
            beside = slice(max(k - 1, 0), k + 1)
            flat, plumb = int((rise[beside] <= run[beside]).sum()), bool((run[beside] <= _PLUMB_M).all())
            found[node].append(((flat == 0, -flat, -tall, -down), plumb, walls[k, 2:]))
    taken: dict[int, np.ndarray] = {}
    differ: list[tuple[int, float, float]] = []
    for node, stated in found.items():
        if len(stated) == 1:
            taken[node] = stated[0][2]
            continue
        stated.sort(key=lambda one: one[0])
        ordered = np.array([heights for _, _, heights in stated])
        first = np.isfinite(ordered).argmax(axis=0)
        taken[node] = ordered[first, [0, 1]]
        downs = ordered[:, 1]
        apart = np.nan_to_num(np.abs(downs - taken[node][1])) * [not plumb for _, plumb, _ in stated]
        if apart.max() > _DIFFER_M:
            differ.append((node, float(taken[node][1]), float(downs[apart.argmax()])))
    agreed = []
    for nodes, walls in rows:
        up, down = np.array([taken[node] for node in nodes]).T
        keeps = np.isfinite(walls[:, 2]) & ~(walls[:, 3] > down + _DIFFER_M)
        roof = np.where(keeps, walls[:, 2], np.fmax(walls[:, 2], up))
        agreed.append((nodes, np.column_stack([walls[:, :2], roof, down])))
    return agreed, differ


def fill_down(rows: Rows, places_m: np.ndarray, least_m: dict[int, float]) -> tuple[Rows, dict[int, Source]]:
    """Return the rows with a distance down to the floor at every node, and how it is known; nan if no node has one.

    Between nodes where it was measured it varies linearly along the survey's legs, so that all legs that meet at a
    station have one floor. Beyond the last of these it is the median of the measured ones: the depth of a chamber says
    nothing of the passages that lead out of it. Where it is less than what splays reached below a node, `least_m` (m),
    that counts as if it were measured.
    """
    measured_down: dict[int, float] = {}
    graph: nx.Graph = nx.Graph()
    for nodes, walls in rows:
        measured_down |= {n: float(d) for n, d in zip(nodes, walls[:, 3], strict=True) if np.isfinite(d)}
        nx.add_path(graph, nodes)
    least_m = {node: least for node, least in least_m.items() if node in graph and node not in measured_down}
    sources = dict.fromkeys(graph, Source.ASSUMED)
    if not measured_down and not least_m:
        return rows, sources
    usual = float(np.median(list(measured_down.values()))) if measured_down else 0.0
    known, deeper = measured_down, dict[int, float]()
    while True:
        known = known | deeper
        between = _interpolated(graph, known, places_m)
        down = dict.fromkeys(graph, usual) | known | between
        deeper = {node: least for node, least in least_m.items() if node not in known and least > down[node]}
        if not deeper:
            break
    sources |= dict.fromkeys([*between, *known], Source.INTERPOLATED) | dict.fromkeys(measured_down, Source.MEASURED)
    filled = [(nodes, np.column_stack([walls[:, :3], [down[node] for node in nodes]])) for nodes, walls in rows]
    return filled, sources


def _interpolated(graph: nx.Graph, known: dict[int, float], places_m: np.ndarray) -> dict[int, float]:
    """Return values, linear along legs, at the nodes on ways between two nodes whose values are known."""
    joined = graph.copy()
    joined.add_edges_from((_JOINT, node) for node in known)  # ways between known nodes are rings through this one
    blocks: Iterable[Any] = nx.biconnected_components(joined)
    on_ways = set[int]().union(*(block for block in blocks if _JOINT in block)) - {_JOINT}
    free = sorted(on_ways - known.keys())
    if not free:
        return {}
    number = {node: row for row, node in enumerate(free)}
    pairs = np.array([edge for edge in graph.subgraph(on_ways).edges if edge[0] != edge[1]])
    stiffness = 1.0 / np.maximum(np.linalg.norm(places_m[pairs[:, 0]] - places_m[pairs[:, 1]], axis=1), 1e-3)
    matrix, target = lil_matrix((len(free), len(free))), np.zeros(len(free))
    for pair, weight in zip(pairs.tolist(), stiffness.tolist(), strict=True):
        for one, other in (pair, pair[::-1]):
            if one in known:
                continue
            matrix[number[one], number[one]] += weight
            if other in known:
                target[number[one]] += weight * known[other]
            else:
                matrix[number[one], number[other]] -= weight
    return dict(zip(free, np.atleast_1d(spsolve(matrix.tocsc(), target)).tolist(), strict=True))
