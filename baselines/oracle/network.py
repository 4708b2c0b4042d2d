"""A mine as a network of driving times: bands that the fastest robot reaches in turn, and the cells seen from each."""

from __future__ import annotations

from dataclasses import dataclass

import networkx as nx
import numpy as np
from scipy.ndimage import label
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from baselines.base.speed import top_speed_mps
from baselines.oracle.problem import CoverageProblem
from baselines.oracle.visibility import cells_in_view
from minexplore.world import World

_STEPS = [(i, j) for i in range(-3, 4) for j in range(-3, 4) if np.gcd(i, j) == 1]
_METRIC = 1.014  # a path in these 32 directions is at most this many times as long as the straight line
_SINK_M = 0.2  # half a cell's diagonal and a soft contact: how much nearer to rock than its radius a robot may be
_EXIT_PART = 0.3  # the last part of a band, in which the place between it and the next one is chosen


@dataclass(frozen=True)
class TimeNetwork:
    """The bands' network, and the coverage cells that can be seen when a node is touched.

    An edge is a band, which takes at least `band_s` to cross. Nodes lie between bands; `credit[node]` holds the flat
    indices of the reachable coverage cells in view from the bands that meet there, `places[node]` the place (m) to
    drive to. `standing` is where a robot can be, `arrival_s` the least time to come there.
    """

    graph: nx.MultiGraph
    root: int
    band_s: float
    credit: dict[int, np.ndarray]
    places: dict[int, np.ndarray]
    standing: np.ndarray
    arrival_s: np.ndarray


def time_network(problem: CoverageProblem, band_s: float) -> TimeNetwork:
    """Cut the places where a robot can be into bands of equal least driving time from the spawn.

    The least time differs between two places by at most the driving time between them, so a robot that crosses a band
    from one side to the other needs at least `band_s`. Two simplifications make a bound higher, never lower: turning
    round inside a band costs nothing, and a band counts as seen whole as soon as it is touched.

    Parameters
    ----------
    problem : CoverageProblem
    band_s : float
    """
    world = problem.world
    spawn = np.array(world.record["spawn"]["anchor_m"])
    start = tuple(_cells_at(problem, spawn[None])[0].tolist())
    standing, arrival = arrival_times(problem, spawn[None])
    reached_s = np.where(np.isfinite(arrival), arrival, 0.0)
    band = np.where(np.isfinite(arrival), reached_s // band_s, -1).astype(int)
    regions = _regions(band)
    ends = _join(regions, band)
    passable = np.unique(_touching(regions, band)[:, 0])  # regions with another one beyond them
    graph: nx.MultiGraph = nx.MultiGraph()
    graph.add_nodes_from(ends[1:, 0].tolist())
    graph.add_edges_from(ends[passable].tolist())
    root = int(ends[regions[start], 0])
    late = np.where(reached_s % band_s > (1 - _EXIT_PART) * band_s, regions, 0)
    places = _places(world, regions, late, {region: int(ends[region, 1]) for region in passable.tolist()})
    credit = _credit(cells_in_view(problem, regions), ends, passable, list(graph))
    return TimeNetwork(graph, root, band_s, credit, places | {root: spawn}, standing, arrival)


def _credit(seen: list[np.ndarray], ends: np.ndarray, passable: np.ndarray, nodes: list[int]) -> dict[int, np.ndarray]:
    """Return the cells in view from the regions that meet at each node."""
    credit: dict[int, set[int]] = {node: set() for node in nodes}
    for region in range(1, len(seen)):
        credit[int(ends[region, 0])].update(seen[region])
    for region in passable.tolist():
        credit[int(ends[region, 1])].update(seen[region])
    return {node: np.array(sorted(cells), dtype=int) for node, cells in credit.items()}


def _places(world: World, regions: np.ndarray, late: np.ndarray, node_of: dict[int, int]) -> dict[int, np.ndarray]:
    """Return the place (2,) m of each node: where the last part of its regions is widest."""
    widest = {region: float(world.clearance_m[late == region].max(initial=0.0)) for region in node_of}
    places = {}
    for region in sorted(node_of, key=lambda region: widest[region]):
        rows, cols = np.nonzero(late == region if (late == region).any() else regions == region)
        best = int(world.clearance_m[rows, cols].argmax())
        places[node_of[region]] = world.origin_m + (np.array([cols[best], rows[best]]) + 0.5) * world.cell_m
    return places


def _regions(band: np.ndarray) -> np.ndarray:
    """Return the connected components of every band, numbered from 1; 0 where no robot can be."""
    regions = np.zeros(band.shape, dtype=int)
    for level in range(band.max() + 1):
        found, _ = label(band == level, structure=np.ones((3, 3)))
        regions[found > 0] = found[found > 0] + regions.max()
    return regions


def _cells_at(problem: CoverageProblem, places_m: np.ndarray) -> np.ndarray:
    """Return row and column (n, 2) of places (n, 2) m in the grid of the world's clearance."""
    return np.floor((places_m - problem.world.origin_m) / problem.world.cell_m).astype(int)[:, ::-1]


def arrival_times(problem: CoverageProblem, starts_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where a robot can be, and the least time, s, in which it comes there from the nearest of places (n, 2) m.

    Both are (rows, cols) in the grid of the world's clearance; the time is infinite where no way leads.
    """
    world, task = problem.world, problem.task
    standing = world.clearance_m >= problem.robot.radius_m - _SINK_M
    east = world.origin_m[0] + (np.arange(standing.shape[1]) + 0.5) * world.cell_m
    speed = top_speed_mps(world, task, east)
    slowness = np.broadcast_to(world.cell_m / speed, standing.shape)
    number = np.full(standing.shape, -1)
    number[standing] = np.arange(standing.sum())
    links = []
    for i, j in _STEPS:
        ours, theirs = _shifted(number, i, j), _shifted(number, -i, -j)
        both = (ours >= 0) & (theirs >= 0)
        cost = np.hypot(i, j) * (_shifted(slowness, i, j)[both] + _shifted(slowness, -i, -j)[both]) / 2
        links.append((ours[both], theirs[both], cost))
    row, col, cost = (np.concatenate(part) for part in zip(*links, strict=True))
    graph = coo_matrix((cost, (row, col)), shape=(standing.sum(),) * 2).tocsr()
    times = np.full(standing.shape, np.inf)
    times[standing] = dijkstra(graph, indices=number[tuple(_cells_at(problem, starts_m).T)], min_only=True) / _METRIC
    return standing, times


def _shifted(grid: np.ndarray, i: int, j: int) -> np.ndarray:
    """Return the part of a grid whose cells have a neighbour at (i, j); with (-i, -j) those neighbours."""
    rows, cols = grid.shape
    return grid[max(0, -i) : rows - max(0, i), max(0, -j) : cols - max(0, j)]


def _touching(regions: np.ndarray, band: np.ndarray) -> np.ndarray:
    """Return pairs (n, 2) of regions that touch, the lower band first."""
    pairs = []
    for ours, theirs in (
        ((slice(None), slice(1, None)), (slice(None), slice(None, -1))),
        ((slice(1, None), slice(None)), (slice(None, -1), slice(None))),
        ((slice(1, None), slice(1, None)), (slice(None, -1), slice(None, -1))),
        ((slice(1, None), slice(None, -1)), (slice(None, -1), slice(1, None))),
    ):
        a, b, low, high = regions[ours], regions[theirs], band[ours], band[theirs]
        meet = (a > 0) & (b > 0) & (low != high)
        upward = (low < high)[meet]
        pairs.append(np.column_stack([np.where(upward, a[meet], b[meet]), np.where(upward, b[meet], a[meet])]))
    return np.unique(np.concatenate(pairs), axis=0)


def _join(regions: np.ndarray, band: np.ndarray) -> np.ndarray:
    """Return the nodes (regions + 1, 2) at the near and the far side of every region; touching ones share a node."""
    count = int(regions.max())
    sides = nx.utils.UnionFind(range(2 * count + 2))
    for below, above in _touching(regions, band).tolist():
        sides.union(2 * below + 1, 2 * above)
    return np.array([[sides[2 * region], sides[2 * region + 1]] for region in range(count + 1)])
