"""The graph of a map that grows: what `map_graph` returns, computed anew only where the map may have changed."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt, label
from scipy.sparse import coo_matrix, csr_matrix

from baselines.explorers.maps.map_graph import BLOCK_CELLS, MARGIN_M, NEIGHBOURS, MapGraph, link_places, widest_places
from baselines.explorers.maps.own_map import FINE, ROCK, UNKNOWN, OwnMap

_MARGIN_CELLS = 4  # round what has changed: a new wall moves the widest places that are so near
_VIEW_CELLS = 5  # beyond those: walls that are farther away than 10 m do not matter

Box = tuple[int, int, int, int]  # first row, end row, first column, end column of coverage cells


class GrowingGraph:
    """Places and links of a map of fixed extent, kept up to date box by box."""

    def __init__(self, own: OwnMap, radius_m: float) -> None:
        """Take an empty map; it must not grow."""
        self.own, self._clear_m = own, radius_m + MARGIN_M
        shape = own.seen.shape
        self._at = np.zeros((*shape, 2), dtype=int)  # the fine cell with the most clearance
        self._widest_m = np.zeros(shape)
        self._cost_m = np.full((len(NEIGHBOURS), *shape), np.inf)  # of the link to each neighbour
        self._frontier = np.zeros(shape, dtype=bool)
        self._known: Box = (shape[0], 0, shape[1], 0)  # encloses all that has changed

    def update(self, changed: Box) -> None:
        """Compute places, links and frontier again round a box of cells that may have changed."""
        box = self._grow(changed, _MARGIN_CELLS)
        k, c = self._known, changed
        self._known = self._grow((min(k[0], c[0]), max(k[1], c[1]), min(k[2], c[2]), max(k[3], c[3])), 1)
        view = self._grow(box, _VIEW_CELLS)
        # Samples half way between two fine cells are rounded to the even one: all views count from an even cell.
        view = (view[0] - view[0] % 2, view[1], view[2] - view[2] % 2, view[3])
        part = OwnMap(self.own.cell_m)
        part.seen, part.fine = self.own.seen[_cells(view)], self.own.fine[_fine_cells(view)]
        clearance = distance_transform_edt(part.fine != ROCK) * self.own.fine_m
        found, widest = widest_places(part.fine, clearance, self._clear_m)
        inner = (slice(box[0] - view[0], box[1] - view[0]), slice(box[2] - view[2], box[3] - view[2]))
        best, corner = found[inner], np.indices(self.own.seen.shape)[:, *_cells(box)] * FINE
        self._at[_cells(box)] = np.stack([corner[0] + best // FINE, corner[1] + best % FINE], axis=-1)
        self._widest_m[_cells(box)] = widest[inner]
        self._frontier[_cells(box)] = part.frontier()[inner]
        self._link(self._grow(box, 1), view, clearance, part.fine == UNKNOWN)

    def _grow(self, box: Box, cells: int) -> Box:
        rows, cols = self.own.seen.shape
        return max(box[0] - cells, 0), min(box[1] + cells, rows), max(box[2] - cells, 0), min(box[3] + cells, cols)

    def _link(self, box: Box, view: Box, clearance: np.ndarray, unknown: np.ndarray) -> None:
        """Compute the links within a box of cells; the arrays are those of a view round it."""
        wanted = (self.own.seen | self._frontier)[_cells(box)] & (self._widest_m[_cells(box)] >= self._clear_m)
        number = np.full(wanted.shape, -1)
        number[wanted] = np.arange(wanted.sum())
        cell = np.argwhere(wanted)
        at = self._at[_cells(box)][wanted] - [view[0] * FINE, view[2] * FINE]
        seen = self.own.seen[_cells(box)][wanted]
        found = link_places(number, seen, at, clearance, unknown, self._clear_m, self.own.fine_m).tocoo()
        step = cell[found.col] - cell[found.row]
        costs = self._cost_m[:, *_cells(box)]
        for kind, (i, j) in enumerate(NEIGHBOURS):
            rows, cols = costs[kind].shape
            costs[kind, : rows - i, max(0, -j) : cols - max(0, j)] = np.inf
            these = (step == (i, j)).all(axis=1)
            start = cell[found.row[these]]
            costs[kind, start[:, 0], start[:, 1]] = found.data[these]

    def graph(self, keep: np.ndarray) -> MapGraph:
        """Return the graph, with the frontier cells (rows, cols) that are worth driving to."""
        box = self._known
        window = _cells(box)
        if box[0] >= box[1]:
            nothing = np.zeros((0, 2))
            return MapGraph(
                nothing.astype(int), nothing, csr_matrix((0, 0)), np.zeros(0, dtype=int), self.own, self._clear_m
            )
        frontier = self._frontier[window] & keep[window]
        node = (self.own.seen[window] | frontier) & (self._widest_m[window] >= self._clear_m)
        number = np.full(node.shape, -1)
        number[node] = np.arange(node.sum())
        cell, corner = np.argwhere(node), np.array([box[0], box[2]])
        places = self.own.centres(self._at[window][node])
        groups = _number_clusters(frontier, corner + self.own.low[::-1])
        links = self._links_of(number, self._cost_m[:, *window])
        return MapGraph((cell + corner)[:, ::-1] + self.own.low, places, links, groups[node], self.own, self._clear_m)

    def _links_of(self, number: np.ndarray, costs: np.ndarray) -> csr_matrix:
        """Return the links (n, n) between numbered cells."""
        rows, cols = number.shape
        ours, theirs, lengths = [], [], []
        for kind, (i, j) in enumerate(NEIGHBOURS):
            here = (slice(0, rows - i), slice(max(0, -j), cols - max(0, j)))
            a, b, cost = number[here], number[i:, max(0, j) : cols - max(0, -j)], costs[kind][here]
            linked = (a >= 0) & (b >= 0) & np.isfinite(cost)
            ours.append(a[linked])
            theirs.append(b[linked])
            lengths.append(cost[linked])
        count = int(number.max()) + 1
        ends = (np.concatenate(ours), np.concatenate(theirs))
        return coo_matrix((np.concatenate(lengths), ends), shape=(count, count)).tocsr()


def _cells(box: Box) -> tuple[slice, slice]:
    return slice(box[0], box[1]), slice(box[2], box[3])


def _fine_cells(box: Box) -> tuple[slice, slice]:
    return slice(box[0] * FINE, box[1] * FINE), slice(box[2] * FINE, box[3] * FINE)


def _number_clusters(frontier: np.ndarray, corner: np.ndarray) -> np.ndarray:
    """Return what `map_graph` numbers so, by keys that are faster to sort."""
    row, col = np.nonzero(frontier)
    found = np.zeros(frontier.shape, dtype=int)
    if len(row):
        part = label(frontier, structure=np.ones((3, 3)))[0][row, col].astype(int)
        block = (np.column_stack([row, col]) + corner) // BLOCK_CELLS
        block -= block.min(axis=0)
        size = block.max(axis=0) + 1
        keys = (part * size[0] + block[:, 0]) * size[1] + block[:, 1]
        found[row, col] = np.unique(keys, return_inverse=True)[1] + 1
    return found
