"""The most cells that any robot can have seen by a time: a mixed-integer program over walks on the time network."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import networkx as nx
import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import coo_matrix

from baselines.oracle.network import TimeNetwork

Row = tuple[list[int], list[float], float, float]  # columns, their coefficients, lower and upper limit of the sum

_RELATIVE_GAP = 1e-3
_MOST_LOOPS = 2000  # a mine of rooms and pillars has more loops than can be listed


@dataclass(frozen=True)
class Walk:
    """The bound on cells, the cells of the best walk found, and that walk's passages (node, node)."""

    most: int
    found: int
    passages: list[tuple[int, int]]


def best_walk(network: TimeNetwork, seconds: float, limit_s: float = 60.0) -> Walk:
    """Return an upper bound on the cells seen within a time, and the walk found that sees the most cells.

    A walk begins at the root and uses an edge at most once in each direction; more uses never help. It enters every
    node as often as it leaves it, except at its two ends, and it is connected. Each passage takes `band_s`. A cell
    counts when the walk touches a node from which it is in view. The bound is the solver's dual bound, so it holds
    where the solver runs out of time.

    Parameters
    ----------
    network : TimeNetwork
    seconds : float
    limit_s : float
        Wall-clock time of the solver. A busy machine gives a higher bound, never a wrong one.
    """
    program = _Program(network, int(seconds // network.band_s))
    answer = milp(
        program.objective(),
        integrality=program.integrality(),
        bounds=program.bounds(),
        constraints=program.constraints(),
        options={"time_limit": limit_s, "mip_rel_gap": _RELATIVE_GAP},
    )
    most = int(-program.objective().sum())
    if answer.mip_dual_bound is not None:
        most = min(most, int(np.floor(-answer.mip_dual_bound + 1e-6)))
    if answer.x is None:
        return Walk(most, 0, [])
    return Walk(most, round(-answer.fun), program.passages_of(answer.x))


class _Program:
    """The variables and constraints of a walk of at most so many passages.

    Columns, all in [0, 1]: for each node whether it is `touched` and whether it is the `last` one; for each arc (a
    directed edge) whether it is `used` and whether it is the `entry`, the arc by which its end is touched first; for
    each group of cells in view from the same nodes whether it is `seen`.
    """

    def __init__(self, network: TimeNetwork, passages: int) -> None:
        self._passages = passages
        hops = nx.single_source_shortest_path_length(network.graph, network.root, cutoff=passages)
        self._nodes = sorted(hops)
        self._number = {node: i for i, node in enumerate(self._nodes)}
        self._graph: nx.Graph = nx.Graph(network.graph.subgraph(hops))
        self._graph.remove_edges_from(list(nx.selfloop_edges(self._graph)))
        pairs = ((self._number[u], self._number[v]) for u, v in self._graph.edges)
        self._arcs = sorted({arc for u, v in pairs for arc in ((u, v), (v, u))})
        self._groups = _groups(network, self._nodes)
        self._root = self._number[network.root]
        self._into: list[list[int]] = [[] for _ in self._nodes]
        self._out: list[list[int]] = [[] for _ in self._nodes]
        for i, (u, v) in enumerate(self._arcs):
            self._out[u].append(i)
            self._into[v].append(i)
        nodes, arcs = len(self._nodes), len(self._arcs)
        self._last, self._used, self._entry, self._seen = nodes, 2 * nodes, 2 * nodes + arcs, 2 * nodes + 2 * arcs
        self._size = self._seen + len(self._groups)

    def objective(self) -> np.ndarray:
        """Return minus the cells of each column."""
        gain = np.zeros(self._size)
        gain[self._seen :] = [-len(cells) for _, cells in self._groups]
        return gain

    def integrality(self) -> np.ndarray:
        """Return 1 for whole columns; a group is whole where its nodes are."""
        whole = np.zeros(self._size)
        whole[: self._seen] = 1
        return whole

    def bounds(self) -> Bounds:
        """Return the columns' limits: the root is touched, and no arc is an entry into it."""
        low, high = np.zeros(self._size), np.ones(self._size)
        low[self._root] = 1
        high[[self._entry + i for i in self._into[self._root]]] = 0
        return Bounds(low, high)

    def constraints(self) -> LinearConstraint:
        """Return all rows as one constraint."""
        rows = [*self._length(), *self._walk(), *self._entries(), *self._loops(), *self._views()]
        row = np.repeat(np.arange(len(rows)), [len(r[0]) for r in rows])
        col, value = (np.concatenate([r[i] for r in rows]) for i in (0, 1))
        matrix = coo_matrix((value.astype(float), (row, col)), shape=(len(rows), self._size)).tocsr()
        return LinearConstraint(matrix, [r[2] for r in rows], [r[3] for r in rows])

    def passages_of(self, x: np.ndarray) -> list[tuple[int, int]]:
        """Return the passages (node, node) of a solution."""
        used = np.rint(x[self._used : self._used + len(self._arcs)]).astype(bool)
        return [(self._nodes[u], self._nodes[v]) for (u, v), yes in zip(self._arcs, used, strict=True) if yes]

    def _length(self) -> Iterator[Row]:
        """Yield: one node is the last; the walk has at most so many passages."""
        yield [*range(self._last, self._used)], [1] * len(self._nodes), 1, 1
        yield [*range(self._used, self._entry)], [1] * len(self._arcs), 0, self._passages

    def _walk(self) -> Iterator[Row]:
        """Yield: the walk leaves a node as often as it enters it, but for its ends; its last node is touched."""
        for i in range(len(self._nodes)):
            begins = float(i == self._root)
            out, into = ([self._used + j for j in arcs[i]] for arcs in (self._out, self._into))
            yield [*out, *into, self._last + i], [*([1] * len(out)), *([-1] * len(into)), 1], begins, begins
            yield [self._last + i, i], [1, -1], -np.inf, 0

    def _entries(self) -> Iterator[Row]:
        """Yield: the entries form a tree, which connects the walk.

        Every touched node but the root has one entry. An entry is used. It leaves a node that was entered from
        elsewhere before.
        """
        for i in range(len(self._nodes)):
            if i != self._root:
                into = [self._entry + j for j in self._into[i]]
                yield [i, *into], [1, *([-1] * len(into))], 0, 0
        for i, (u, v) in enumerate(self._arcs):
            yield [self._entry + i, self._used + i], [1, -1], -np.inf, 0
            if u != self._root:
                before = [self._entry + j for j in self._into[u] if self._arcs[j][0] != v]
                yield [self._entry + i, *before], [1, *([-1] * len(before))], -np.inf, 0

    def _loops(self) -> Iterator[Row]:
        """Yield: no loop of the mine consists of entries; without the rows of more loops the bound is higher."""
        entry = {arc: self._entry + i for i, arc in enumerate(self._arcs)}
        for loop in itertools.islice(nx.simple_cycles(self._graph), _MOST_LOOPS):
            ring = [self._number[node] for node in loop]
            for way in (ring, ring[::-1]):
                links = [entry[way[i - 1], way[i]] for i in range(len(way))]
                yield links, [1] * len(links), -np.inf, len(links) - 1

    def _views(self) -> Iterator[Row]:
        """Yield: a group of cells is seen only if one of its nodes is touched."""
        for j, (members, _) in enumerate(self._groups):
            nodes = [self._number[node] for node in members]
            yield [self._seen + j, *nodes], [1, *([-1] * len(nodes))], -np.inf, 0


def _groups(network: TimeNetwork, nodes: list[int]) -> list[tuple[tuple[int, ...], list[int]]]:
    """Return the cells in groups that are in view from the same nodes."""
    seen_from: dict[int, list[int]] = {}
    for node in nodes:
        for cell in network.credit[node].tolist():
            seen_from.setdefault(cell, []).append(node)
    groups: dict[tuple[int, ...], list[int]] = {}
    for cell, members in seen_from.items():
        groups.setdefault(tuple(members), []).append(cell)
    return sorted(groups.items())
