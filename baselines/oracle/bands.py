"""Heights over columns that are joined, and their bands of equal least time as a network."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import networkx as nx
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from baselines.oracle.network import _STEPS, TimeNetwork, _credit

BESIDE = ((0, 1), (1, -1), (1, 0), (1, 1))  # rows and columns to half of the columns beside one, also at a corner


def joined_pairs(
    column: np.ndarray, row: np.ndarray, low_m: np.ndarray, high_m: np.ndarray, steps: Sequence[tuple[int, int]] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs (n, 2) of spans in columns some steps apart that have a height in common, and those steps' lengths.

    Parameters
    ----------
    column, row : (s,) int
    low_m, high_m : (s,) float64, m
        The heights of the spans.
    steps : sequence of (int, int)
        Rows and columns from the first to the second, each way once; by default those of `time_network`.

    Returns
    -------
    pairs : (n, 2) int
    length : (n,) float64
        In cells.
    """
    column, row = column.astype(np.int64), row.astype(np.int64)
    wide = int(column.max()) + 8
    key = (row + 4) * wide + column + 4
    order = np.argsort(key, kind="stable")
    keys, found = key[order], []
    for north, east in steps or [step for step in _STEPS if step > (0, 0)]:
        start, end = (np.searchsorted(keys, key + north * wide + east, side=side) for side in ("left", "right"))
        for k in range(int((end - start).max(initial=0))):
            one = np.flatnonzero(start + k < end)
            two = order[start[one] + k]
            meets = np.minimum(high_m[one], high_m[two]) > np.maximum(low_m[one], low_m[two])
            found.append(np.column_stack([one[meets], two[meets], np.full(meets.sum(), north**2 + east**2)]))
    every = np.concatenate([np.zeros((0, 3), np.int64), *found])
    return every[:, :2], np.sqrt(every[:, 2])


@dataclass(frozen=True)
class TimeBands:
    """Spans (s,) in regions of one band each, the regions' ends, and the regions that others are beyond.

    `regions` (s,) are numbers from 1, 0 where no robot comes; `ends` (regions + 1, 2) the nodes at the near and the far
    side of each.
    """

    band_s: float
    time_s: np.ndarray
    regions: np.ndarray
    ends: np.ndarray
    passable: np.ndarray

    def network(self, start: int, seen: list[np.ndarray]) -> TimeNetwork:
        """Return the network from the span `start` on, of which each region sees some cells; no tour is driven on it.

        It has the times and the standing places of these spans, and no places to drive to.
        """
        graph: nx.MultiGraph = nx.MultiGraph()
        graph.add_nodes_from(self.ends[1:, 0].tolist())
        graph.add_edges_from(self.ends[self.passable].tolist())
        credit = _credit(seen, self.ends, self.passable, list(graph))
        root = int(self.ends[self.regions[start], 0])
        return TimeNetwork(graph, root, self.band_s, credit, {}, np.isfinite(self.time_s), self.time_s)


def cut_into_bands(time_s: np.ndarray, pairs: np.ndarray, band_s: float) -> TimeBands:
    """Cut spans with least times (s,), infinite where no robot comes, into bands, as `time_network` does."""
    reached = np.isfinite(time_s)
    band = np.where(reached, np.where(reached, time_s, 0.0) // band_s, -1).astype(int)
    regions = _regions(band, pairs)
    touching = _touching(regions, band, pairs)
    sides = nx.utils.UnionFind(range(2 * int(regions.max()) + 2))
    for below, above in touching.tolist():
        sides.union(2 * below + 1, 2 * above)
    ends = np.array([[sides[2 * region], sides[2 * region + 1]] for region in range(int(regions.max()) + 1)])
    return TimeBands(band_s, time_s, regions, ends, np.unique(touching[:, 0]))


def _regions(band: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return the connected parts of every band (n,), numbered from 1 by band and first span; 0 where no robot comes."""
    same = pairs[(band[pairs[:, 0]] == band[pairs[:, 1]]) & (band[pairs[:, 0]] >= 0)]
    label = connected_components(coo_matrix((np.ones(len(same)), same.T), shape=(len(band),) * 2), directed=False)[1]
    reached = np.flatnonzero(band >= 0)
    _, first, number = np.unique(label[reached], return_index=True, return_inverse=True)
    order = np.lexsort([first, band[reached[first]]])
    found = np.zeros(len(band), int)
    found[reached] = np.argsort(order)[number.reshape(-1)] + 1
    return found


def _touching(regions: np.ndarray, band: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return pairs (n, 2) of regions that touch, the lower band first."""
    one, two = pairs.T
    meet = (regions[one] > 0) & (regions[two] > 0) & (band[one] != band[two])
    upward = band[one][meet] < band[two][meet]
    a, b = regions[one][meet], regions[two][meet]
    return np.unique(np.column_stack([np.where(upward, a, b), np.where(upward, b, a)]), axis=0)
