"""The most cells that any robot can have seen by a time: a walk on the time network that collects cells, by HiGHS."""

from __future__ import annotations

from dataclasses import dataclass

import networkx as nx
import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import coo_matrix

from baselines.oracle.network import TimeNetwork

Row = tuple[list[int], list[float], float, float]


@dataclass(frozen=True)
class Walk:
    """The bound on cells, the cells of the best walk found, and that walk's passages (node, node)."""

    most: int
    found: int
    passages: list[tuple[int, int]]


def best_walk(network: TimeNetwork, seconds: float, limit_s: float = 60.0) -> Walk:
    """Return an upper bound on the cells seen within a time, and the walk that reaches most of it.

    A walk from the root passes an edge at most once each way (more never helps), enters every node as often as it
    leaves it, but for its two ends, and hangs together; each passage takes `band_s`. A cell counts when a node that it
    is in view from is touched. That it hangs together is said by a tree: every touched node but the root was first
    entered from one other, which was entered before, and not from this one; no loop of the mine is such a tree. The
    bound is the solver's dual bound, so it holds where the solver runs out of time.

    Parameters
    ----------
    network : TimeNetwork
    seconds : float
    limit_s : float
        For the solver.
    """
    passages = int(seconds // network.band_s)
    hops = nx.single_source_shortest_path_length(network.graph, network.root, cutoff=passages)
    nodes = sorted(hops)
    number = {node: i for i, node in enumerate(nodes)}
    near: nx.Graph = nx.Graph(network.graph.subgraph(hops))
    near.remove_edges_from(list(nx.selfloop_edges(near)))
    arcs = sorted({(number[a], number[b]) for u, v in near.edges for a, b in ((u, v), (v, u))})
    groups = _groups(network, nodes)
    n, m, root = len(nodes), len(arcs), number[network.root]
    # y touched (n), t last (n), a passages (m), b first entries (m), z groups seen (g)
    t, a, b, z = n, 2 * n, 2 * n + m, 2 * n + 2 * m
    size = z + len(groups)
    into: list[list[int]] = [[] for _ in nodes]
    out: list[list[int]] = [[] for _ in nodes]
    for i, (u, v) in enumerate(arcs):
        out[u].append(i)
        into[v].append(i)
    rows: list[Row] = [([*range(t, t + n)], [1] * n, 1, 1), ([*range(a, a + m)], [1] * m, 0, passages)]
    for i, (u, v) in enumerate(arcs):
        rows.append(([b + i, a + i], [1, -1], -np.inf, 0))
        if u != root:
            before = [b + j for j in into[u] if arcs[j][0] != v]
            rows.append(([b + i, *before], [1, *([-1] * len(before))], -np.inf, 0))
    for i in range(n):
        begins = float(i == root)
        ways = [*(a + j for j in out[i]), *(a + j for j in into[i])]
        rows.append(([*ways, t + i], [*([1] * len(out[i])), *([-1] * len(into[i])), 1], begins, begins))
        rows.append(([t + i, i], [1, -1], -np.inf, 0))
        if i != root:
            rows.append(([i, *(b + j for j in into[i])], [1, *([-1] * len(into[i]))], 0, 0))
    at = {arc: b + i for i, arc in enumerate(arcs)}
    for loop in nx.simple_cycles(near):
        ring = [number[node] for node in loop]
        for way in (ring, ring[::-1]):
            links = [at[way[i - 1], way[i]] for i in range(len(way))]
            rows.append((links, [1] * len(links), -np.inf, len(links) - 1))
    for j, (members, _) in enumerate(groups):
        rows.append(([z + j, *(number[node] for node in members)], [1, *([-1] * len(members))], -np.inf, 0))
    gain = np.zeros(size)
    gain[z:] = [-len(cells) for _, cells in groups]
    low, high, whole = np.zeros(size), np.ones(size), np.zeros(size)
    low[root], whole[:z] = 1, 1
    high[[b + i for i in into[root]]] = 0
    answer = milp(
        gain, integrality=whole, bounds=Bounds(low, high), constraints=_matrix(rows, size),
        options={"time_limit": limit_s, "mip_rel_gap": 1e-3},
    )  # fmt: skip
    most = int(-gain.sum())
    if answer.mip_dual_bound is not None:
        most = min(most, int(np.floor(-answer.mip_dual_bound + 1e-6)))
    if answer.x is None:
        return Walk(most, 0, [])
    used = np.rint(answer.x[a : a + m]).astype(bool)
    return Walk(most, round(-answer.fun), [(nodes[u], nodes[v]) for (u, v), yes in zip(arcs, used, strict=True) if yes])


def _groups(network: TimeNetwork, nodes: list[int]) -> list[tuple[tuple[int, ...], list[int]]]:
    """Return cells that are seen from the same nodes, together."""
    seen_from: dict[int, list[int]] = {}
    for node in nodes:
        for cell in network.credit[node].tolist():
            seen_from.setdefault(cell, []).append(node)
    groups: dict[tuple[int, ...], list[int]] = {}
    for cell, members in seen_from.items():
        groups.setdefault(tuple(members), []).append(cell)
    return sorted(groups.items())


def _matrix(rows: list[Row], size: int) -> LinearConstraint:
    row = np.repeat(np.arange(len(rows)), [len(r[0]) for r in rows])
    col, value = (np.concatenate([r[i] for r in rows]) for i in (0, 1))
    matrix = coo_matrix((value.astype(float), (row, col)), shape=(len(rows), size)).tocsr()
    return LinearConstraint(matrix, [r[2] for r in rows], [r[3] for r in rows])
