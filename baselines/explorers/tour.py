"""Explorers that think beyond the next frontier: by a tour of all, by depth first, by a local and a global tour."""

from __future__ import annotations

import networkx as nx
import numpy as np

from baselines.explorers.graph_explorer import GraphExplorer, Situation

_MOST_STOPS = 12  # of a tour: the nearest clusters
_STUB_CELLS, _STUB_M = 3, 12.0  # a cluster of at most so many cells and so near is a stub
_LOCAL_M = 20.0  # path length within which a cluster belongs to the local tour
_COMMIT_STEPS = 100  # control steps; tours of nearly equal length change their first stop from plan to plan


class FrontierTour(GraphExplorer):
    """Drives to the first stop of the shortest open tour of all clusters (as TSP explorers do; Kulich et al. 2011)."""

    commit_steps = _COMMIT_STEPS

    def choose(self, situation: Situation) -> int:
        """Return the first stop of the tour of the nearest clusters."""
        stops = np.argsort(situation.costs, kind="stable")[:_MOST_STOPS]
        return int(stops[open_tour(_distances(situation, stops))[0]])


class DepthFirst(GraphExplorer):
    """Drives to the frontier found last, but clears short stubs beside its way first (Tremaux's rule for mazes)."""

    commit_steps = _COMMIT_STEPS

    def choose(self, situation: Situation) -> int:
        """Return the nearest stub, or else the nearest of the newest clusters."""
        stub = (situation.sizes <= _STUB_CELLS) & (situation.costs <= _STUB_M)
        if stub.any():
            return int(np.where(stub, situation.costs, np.inf).argmin())
        newest = situation.ages <= situation.ages.min()
        return int(np.where(newest, situation.costs, np.inf).argmin())


class TwoLevel(GraphExplorer):
    """Clears what is near by a local tour that ends towards the global tour of the rest (TARE; Cao et al. 2021)."""

    commit_steps = _COMMIT_STEPS

    def choose(self, situation: Situation) -> int:
        """Return the first stop of the local tour, or of the global one where nothing is near."""
        order = np.argsort(situation.costs, kind="stable")
        local = order[situation.costs[order] <= _LOCAL_M][:_MOST_STOPS]
        far = order[situation.costs[order] > _LOCAL_M][:_MOST_STOPS]
        if not len(local) or not len(far):
            stops = local if len(local) else far
            return int(stops[open_tour(_distances(situation, stops))[0]])
        exit_ = far[open_tour(_distances(situation, far))[0]]
        stops = np.append(local, exit_)
        return int(stops[open_tour(_distances(situation, stops), last=len(local))[0]])


def _distances(situation: Situation, stops: np.ndarray) -> np.ndarray:
    """Return the costs (k + 1, k + 1), m, between the robot, which is first, and stops (k,)."""
    nodes = np.append(situation.robot, situation.goals[stops])
    costs = situation.graph.costs_from(nodes)[0][:, nodes]
    costs[0, 1:] = situation.costs[stops]
    return costs


def open_tour(costs: np.ndarray, last: int | None = None) -> list[int]:
    """Return stops 0 to k - 1 in the order of a short tour that begins at the start and need not come back.

    A tour that comes back for nothing is an open one, so ways back to the start cost nothing; where a `last` stop is
    given, only the way back from it does. Threshold accepting improves the greedy tour (Dueck & Scheuer 1990).

    Parameters
    ----------
    costs : (k + 1, k + 1) m
        Between the start, which is first, and the stops. The way into a stop may differ from the way out.
    last : int, optional
        The stop at which the tour ends.
    """
    count = len(costs)
    if count <= 2:
        return list(range(count - 1))
    way = np.where(np.isfinite(costs), costs, 1e6)
    way[:, 0] = 0.0 if last is None else 1e7
    if last is not None:
        way[last + 1, 0] = 0.0
    graph = nx.from_numpy_array(way + 1e-9, create_using=nx.DiGraph)
    graph.remove_edges_from(list(nx.selfloop_edges(graph)))
    tour = nx.approximation.threshold_accepting_tsp(graph, "greedy", source=0, max_iterations=8, seed=0)
    return [stop - 1 for stop in tour[1:-1]]
