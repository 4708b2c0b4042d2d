"""Distances to walls, roof and floor from a survey's splays, and what stands in for the ones that nobody measured."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import networkx as nx
import numpy as np
from scipy.sparse import lil_matrix
from scipy.sparse.linalg import spsolve

from pipeline.survey.passages.known import known_along
from pipeline.survey.passages.legs import along_stations, says_enough
from pipeline.survey.solved.model import LegFlag, SolvedSurvey
from pipeline.types import Known

_BEYOND_M = 1.0  # ahead of an end, at least: what is nearer is the wall at which the passage ends
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


def walls_across(places_m: np.ndarray, splays: list[np.ndarray | None]) -> np.ndarray:
    """Return the distances left, right, up and down (n, 4) m that splays measure along a row of stations, else nan.

    Of the splays within 45 deg of level and of square to the passage, the longest on each side counts; up and down, the
    longest within 45 deg of plumb. A station whose splays reach one side only stands at the wall of the other: an
    instrument cannot measure the wall that it is held against. Surveyors of narrow drifts go from wall to wall.

    Parameters
    ----------
    places_m : (n, 3) m
    splays : n arrays (k, 3) m, or None
    """
    heading = np.gradient(places_m[:, :2], axis=0)
    heading /= np.maximum(np.linalg.norm(heading, axis=1, keepdims=True), 1e-9)
    walls = np.full((len(places_m), 4), np.nan)
    for row, steps, (east, north) in zip(walls, splays, heading, strict=True):
        if steps is None:
            continue
        along = steps[:, 0] * east + steps[:, 1] * north
        left = steps[:, 1] * east - steps[:, 0] * north
        run = np.hypot(along, left)
        across = left[(np.abs(steps[:, 2]) <= run) & (np.abs(left) >= np.abs(along))]
        if len(across):
            row[:2] = across.max(initial=0.0), (-across).max(initial=0.0)
        for column, rise in ((2, steps[:, 2]), (3, -steps[:, 2])):
            plumb = rise[rise > run]
            if len(plumb):
                row[column] = plumb.max()
    return walls


def beyond_ends(
    chains: list[list[int]], places_m: np.ndarray, splays: dict[int, np.ndarray]
) -> tuple[int, float, int | None]:
    """Return how many splays end beyond the ends of passages, how far, m, the farthest does, and from which node.

    A passage ends where one leg alone does, square to that leg in plan: what lies ahead is in no section. Splays within
    45 deg of plumb measure the roof or the floor and do not count.

    Parameters
    ----------
    chains : rows of nodes
    places_m : (n, 3) m, of the nodes
    splays : arrays (k, 3) m by node
    """
    count, farthest, at = 0, 0.0, None
    legs = Counter(node for chain in chains for pair in pairwise(chain) for node in pair)
    for chain in (chain for chain in chains if len(chain) > 1):
        for end, before in ((chain[0], chain[1]), (chain[-1], chain[-2])):
            step = (places_m[end] - places_m[before])[:2]
            run = float(np.linalg.norm(step))
            if legs[end] > 1 or end not in splays or run < _PLUMB_M:
                continue
            level = np.abs(splays[end][:, 2]) <= np.hypot(*splays[end][:, :2].T)
            ahead = np.append(splays[end][level, :2] @ step / run, 0.0)
            count += int((ahead > _BEYOND_M).sum())
            if ahead.max() > max(farthest, _BEYOND_M):
                farthest, at = float(ahead.max()), end
    return count, farthest, at


def measured(walls: np.ndarray) -> np.ndarray:
    """Return the distances left, right, up and down (n, 4) m; four zeros stand for a section that nobody measured."""
    return np.where((walls == 0).all(axis=1, keepdims=True), np.nan, walls)


def usual_half_width_m(rows: Rows) -> float | None:
    """Return half the median width where both sides are known; None if they are nowhere."""
    widths = [walls[:, :2].sum(axis=1) for _, walls in rows]
    known = np.concatenate(widths) if widths else np.zeros(0)
    known = known[np.isfinite(known)]
    return float(np.median(known)) / 2 if len(known) else None


@dataclass(frozen=True)
class FilledSides:
    """Walls (n, 4) m with both sides of every station, and how the sides (n, 2) are known.

    `unused` are the stations (n,) with a side that is assumed in spite of splays.
    """

    walls: np.ndarray
    known: np.ndarray
    unused: np.ndarray

    @property
    def usual(self) -> np.ndarray:
        """Return the stations (n,) with a side that is assumed."""
        return (self.known == Known.ASSUMED).any(axis=1)

    @property
    def interpolated(self) -> np.ndarray:
        """Return the stations (n,) with a side that is interpolated."""
        return (self.known == Known.INTERPOLATED).any(axis=1)


def fill_sides(walls: np.ndarray, half_width_m: float, sections: np.ndarray) -> FilledSides:
    """Fill in the sides of walls (n, 4) m, of which `sections` (n, 4) m are those of cross-sections, nan elsewhere.

    On a side that less than half of a row's stations have, splays do not count: the few splays of a traverse look into
    side workings, and say nothing of a drift of 200 m. Cross-sections stay.
    """
    filled = walls.copy()
    known = np.zeros((len(walls), 2), np.uint8)
    unused = np.zeros(len(walls), bool)
    for k in (0, 1):
        stated = walls[:, k] if says_enough(walls[:, k]) else sections[:, k]
        filled[:, k] = along_stations(stated, half_width_m)
        known[:, k] = known_along(stated)
        unused |= np.isfinite(walls[:, k]) & ~np.isfinite(stated)
    return FilledSides(filled, known, unused)


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


def fill_down(rows: Rows, places_m: np.ndarray) -> tuple[Rows, dict[int, Known]]:
    """Return the rows with a distance down to the floor at every node, and how it is known by node.

    If no node has one they are nan everywhere.

    Between nodes where it was measured it varies linearly along the survey's legs, so that all legs that meet at a
    station have one floor. Beyond the last of these it is the median of the measured ones: the depth of a chamber says
    nothing of the passages that lead out of it.
    """
    known: dict[int, float] = {}
    graph: nx.Graph = nx.Graph()
    for nodes, walls in rows:
        known |= {n: float(d) for n, d in zip(nodes, walls[:, 3], strict=True) if np.isfinite(d)}
        nx.add_path(graph, nodes)
    if not known:
        return rows, {}
    between = _interpolated(graph, known, places_m)
    down = dict.fromkeys(graph, float(np.median(list(known.values())))) | known | between
    how = dict.fromkeys(graph, Known.ASSUMED)
    how |= dict.fromkeys(known, Known.MEASURED) | dict.fromkeys(between, Known.INTERPOLATED)
    return [(nodes, np.column_stack([walls[:, :3], [down[node] for node in nodes]])) for nodes, walls in rows], how


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
