"""A robot's own map as a graph: a place in each coverage cell, links to drive, and clusters of the frontier."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt, label
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra

from baselines.explorers.maps.own_map import FINE, FREE, ROCK, UNKNOWN, OwnMap

MARGIN_M = 0.1  # between the robot's disc and rock
_NEAR_ROCK_M, _NEAR_ROCK_FACTOR = 0.9, 3.0  # links cost up to 3 times their length nearer to rock than this
_UNKNOWN_FACTOR = 1.5  # of the cost of a link that touches unknown ground
_SAMPLES = 9  # of the clearance along a link; 0.35 m apart on the longest
BLOCK_CELLS = 4  # clusters of the frontier end at the borders of blocks of so many cells
_SKIPPED = 3  # nodes at the start of a path that a robot need not pass
_SPACING_M = 0.4  # of the places of a path
_TRIED = 16  # nodes around a robot, to find one that it sees
NEIGHBOURS = ((0, 1), (1, 0), (1, 1), (1, -1))

Cell = tuple[int, int]  # column and row of a coverage cell, counted from the mine frame's origin


@dataclass(frozen=True)
class MapGraph:
    """Cells of the frontier and seen cells where a robot fits, and how it can drive between them.

    Attributes
    ----------
    cells : (n, 2) int
        Column and row of the coverage cells, counted from the mine frame's origin.
    places : (n, 2) m
        The place with the most clearance in each cell, on ground that a beam has passed if the robot fits there.
    links : (n, n) sparse, m
        Lengths of the links, more near rock and in unknown ground.
    cluster : (n,) int
        Number, from 1, of the cell's cluster of the frontier; 0 for seen cells.
    own : OwnMap
        The map.
    clear_m : float
        From the robot's centre to known rock.
    """

    cells: np.ndarray
    places: np.ndarray
    links: csr_matrix
    cluster: np.ndarray
    own: OwnMap
    clear_m: float

    def costs_from(self, nodes: np.ndarray | list[int]) -> tuple[np.ndarray, np.ndarray]:
        """Return costs (k, n), m, of the cheapest paths from nodes (k,), and the nodes before each on its path (k, n).

        A cost is infinite where no path leads.
        """
        return dijkstra(self.links, directed=False, indices=np.asarray(nodes), return_predecessors=True)

    def maps(self, nodes: np.ndarray) -> list[OwnMap]:
        """Return the map that each of some nodes (k,) is on."""
        return [self.own] * len(nodes)

    def nearest(self, place: np.ndarray) -> int:
        """Return the node that a robot at a place (2,) m starts from: the nearest with a link and no rock between.

        Without such a node it is the nearest with a link, or the nearest of all.
        """
        linked = np.diff(self.links.indptr) + np.bincount(self.links.indices, minlength=len(self.cells)) > 0
        order = np.argsort(np.where(linked, 0.0, 1e6) + np.linalg.norm(self.places - place, axis=1))
        for node in order[:_TRIED].tolist():
            if linked[node] and not _crosses_rock(self.own, place, self.places[node]):
                return int(node)
        return int(order[0])

    def path(self, place: np.ndarray, before: np.ndarray, end: int) -> np.ndarray:
        """Return the path (k, 2), m, of a robot to a node.

        Parameters
        ----------
        place : (2,) m
            Where the robot is. It drives straight to the farthest of the first nodes to which the way is clear.
        before : (n,) int
            The nodes before each, as `costs_from` gives them.
        end : int
            The node.
        """
        nodes = [end]
        while before[nodes[-1]] >= 0:
            nodes.append(int(before[nodes[-1]]))
        corners = self.places[nodes[::-1]]
        clear = [i for i, corner in enumerate(corners[: _SKIPPED + 1]) if self._is_clear(place, corner)]
        first = max(clear, default=0)
        corners = np.concatenate([place[None], corners[first:]])
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
        at = np.linspace(0.0, along[-1], int(along[-1] / _SPACING_M) + 2)
        return np.column_stack([np.interp(at, along, corners[:, axis]) for axis in (0, 1)])

    def _is_clear(self, start: np.ndarray, end: np.ndarray) -> bool:
        """Return whether the straight way between two places (2,) m keeps away from known rock."""
        row, col = self.own.at(_along(start, end, self.own.fine_m / 2), self.own.fine_m)
        low = np.maximum([row.min() - 3, col.min() - 3], 0)
        near = self.own.fine[low[0] : row.max() + 4, low[1] : col.max() + 4] != ROCK
        clearance = distance_transform_edt(near)[row - low[0], col - low[1]] * self.own.fine_m
        return bool((clearance >= self.clear_m).all())


def worth_driving_to(own: OwnMap, given_up: list[Cell], centre: np.ndarray, reach_m: float) -> np.ndarray:
    """Return which cells (rows, cols) of a map lie within reach of a place (2,) m and were not given up."""
    keep = np.ones_like(own.seen)
    for col, row in (np.array(cell) - own.low for cell in given_up):
        keep[row, col] = False
    if np.isfinite(reach_m):
        rows, cols = np.indices(keep.shape)
        places = (np.stack([cols, rows], axis=-1) + 0.5 + own.low) * own.cell_m
        keep &= np.linalg.norm(places - centre, axis=-1) <= reach_m
    return keep


def map_graph(own: OwnMap, radius_m: float, keep: np.ndarray) -> MapGraph:
    """Return the graph of a robot's own map.

    Parameters
    ----------
    own : OwnMap
    radius_m : float
        The robot's.
    keep : (rows, cols) bool
        The frontier cells that are worth driving to.
    """
    frontier, clear_m = own.frontier() & keep, radius_m + MARGIN_M
    rows, cols = np.nonzero(own.seen | frontier)
    if not len(rows):
        nothing = np.zeros((0, 2))
        return MapGraph(nothing.astype(int), nothing, csr_matrix((0, 0)), np.zeros(0, dtype=int), own, clear_m)
    low = np.array([rows.min(), cols.min()]) - 1
    high = np.array([rows.max(), cols.max()]) + 2
    window = tuple(slice(max(int(a), 0), int(b)) for a, b in zip(low, high, strict=True))
    fine = own.fine[tuple(slice(FINE * s.start, FINE * s.stop) for s in window)]
    wanted = (own.seen | frontier)[window]
    clearance = distance_transform_edt(fine != ROCK) * own.fine_m
    best, widest = widest_places(fine, clearance, clear_m)
    node = wanted & (widest >= clear_m)
    number = np.full(wanted.shape, -1)
    number[node] = np.arange(node.sum())
    cell = np.argwhere(node)
    at = cell * FINE + np.column_stack([best[node] // FINE, best[node] % FINE])
    links = link_places(number, own.seen[window][node], at, clearance, fine == UNKNOWN, clear_m, own.fine_m)
    corner = np.array([s.start for s in window])
    groups = _clusters(frontier[window], corner + own.low[::-1])
    places = own.centres(at + corner * FINE)
    return MapGraph((cell + corner)[:, ::-1] + own.low, places, links, groups[node], own, clear_m)


def widest_places(fine: np.ndarray, clearance: np.ndarray, clear_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the place in each coverage cell with the most clearance, and that clearance, m.

    Ground that a beam has passed goes before unknown ground, which may be rock, where it has enough clearance.

    Parameters
    ----------
    fine : (FINE * rows, FINE * cols)
        The map.
    clearance : (FINE * rows, FINE * cols) m
        From known rock.
    clear_m : float
        What the robot needs.

    Returns
    -------
    (rows, cols) int
        Index of the fine cell within the coverage cell, row by row.
    (rows, cols) m
    """
    rows, cols = fine.shape[0] // FINE, fine.shape[1] // FINE
    rank = clearance + np.where((fine == FREE) & (clearance >= clear_m), clearance.max() + 1.0, 0.0)
    best = rank.reshape(rows, FINE, cols, FINE).swapaxes(1, 2).reshape(rows, cols, -1).argmax(axis=2)
    row, col = np.indices((rows, cols)) * FINE
    return best, clearance[row + best // FINE, col + best % FINE]


def _crosses_rock(own: OwnMap, start: np.ndarray, end: np.ndarray) -> bool:
    """Return whether known rock lies on the straight way between two places (2,) m."""
    row, col = own.at(_along(start, end, own.fine_m / 4), own.fine_m)
    return bool((own.fine[row, col] == ROCK).any())


def _along(start: np.ndarray, end: np.ndarray, spacing_m: float) -> np.ndarray:
    steps = int(np.linalg.norm(end - start) / spacing_m) + 2
    return start + np.linspace(0.0, 1.0, steps)[:, None] * (end - start)


def _clusters(frontier: np.ndarray, corner: np.ndarray) -> np.ndarray:
    """Return numbers from 1 of the parts of the frontier (rows, cols) that are connected within a block of cells."""
    rows, cols = np.indices(frontier.shape)
    block = np.stack([rows + corner[0], cols + corner[1]]) // BLOCK_CELLS
    parts = label(frontier, structure=np.ones((3, 3)))[0]
    keys = np.column_stack([parts[frontier], block[0][frontier], block[1][frontier]])
    found = np.zeros(frontier.shape, dtype=int)
    found[frontier] = np.unique(keys, axis=0, return_inverse=True)[1].ravel() + 1
    return found


def link_places(
    number: np.ndarray,
    seen: np.ndarray,
    at: np.ndarray,
    clearance: np.ndarray,
    unknown: np.ndarray,
    clear_m: float,
    fine_m: float,
) -> csr_matrix:
    """Return the links (n, n) between the places `at` (n, 2), fine cells, of neighbouring cells.

    One of the two is `seen` (n,): a way along the frontier, of which nothing is seen, may lead through rock.
    """
    ours, theirs = [], []
    rows, cols = number.shape
    for i, j in NEIGHBOURS:
        a = number[: rows - i, max(0, -j) : cols - max(0, j)]
        b = number[i:, max(0, j) : cols - max(0, -j)]
        both = (a >= 0) & (b >= 0)
        ours.append(a[both])
        theirs.append(b[both])
    start, end = np.concatenate(ours), np.concatenate(theirs)
    share = np.linspace(0.0, 1.0, _SAMPLES)[:, None, None]
    between = np.rint(at[start] * (1 - share) + at[end] * share).astype(int)  # (samples, links, 2)
    width = clearance[between[..., 0], between[..., 1]]
    length = np.linalg.norm((at[start] - at[end]) * fine_m, axis=1)
    near = np.clip((_NEAR_ROCK_M - width) / _NEAR_ROCK_M, 0.0, 1.0).mean(axis=0)
    dark = unknown[between[..., 0], between[..., 1]].mean(axis=0)
    cost = length * (1 + (_NEAR_ROCK_FACTOR - 1) * near) * (1 + (_UNKNOWN_FACTOR - 1) * dark)
    open_ = (width >= clear_m).all(axis=0) & (seen[start] | seen[end])
    return coo_matrix((cost[open_], (start[open_], end[open_])), shape=(len(at), len(at))).tocsr()
