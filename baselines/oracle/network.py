"""A mine as a network of times: bands that the fastest robot reaches one after another, and what is seen from each."""

from __future__ import annotations

from dataclasses import dataclass

import networkx as nx
import numpy as np
from scipy.ndimage import binary_dilation, label
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from baselines.speed import top_speed_mps
from minexplore.explorers import Explorers

_STEPS = [(i, j) for i in range(-3, 4) for j in range(-3, 4) if np.gcd(i, j) == 1]
_METRIC = 1.014  # most by which a way in these 32 directions is longer than the straight one
_SINK_M = 0.2  # half a cell's diagonal and a soft contact: how much nearer to rock than its radius a robot may be
_SURFACE_M = 0.5  # how far behind the collision wall the visible rock may stand back
_SAMPLE_M, _RAYS, _MARCH_M = 0.75, 360, 0.2
_LEAVING = 0.3  # the last part of a band, in which the place between it and the next is chosen


@dataclass(frozen=True)
class TimeNetwork:
    """The bands' network, and the coverage cells that can be seen when a node is touched.

    An edge is a band: to pass it takes at least `band_s`. Nodes lie between bands; `credit[node]` holds the flat
    indices of reachable coverage cells in view from the bands that meet there, `places[node]` where to drive to (m).
    """

    graph: nx.MultiGraph
    root: int
    band_s: float
    credit: dict[int, np.ndarray]
    places: dict[int, np.ndarray]
    standing: np.ndarray
    arrival_s: np.ndarray


def time_network(explorers: Explorers, band_s: float) -> TimeNetwork:
    """Cut the places where a robot can be into bands of the least time it takes to come there from the spawn.

    That least time changes between two places by no more than the way between them takes, so whoever passes a band
    from one side to the other needs at least `band_s`; to turn round in a band is taken to cost nothing. Both, and that
    a band is seen whole as soon as it is touched, can only make a bound higher.

    Parameters
    ----------
    explorers : Explorers
        Gives world, task, robot and the reachable coverage cells.
    band_s : float
    """
    world = explorers.world
    standing = world.clearance_m >= explorers.robot.radius_m - _SINK_M
    spawn = np.array(world.record["spawn"]["anchor_m"])
    start = tuple(np.floor((spawn - world.origin_m) / world.cell_m).astype(int)[::-1].tolist())
    arrival = _arrival(explorers, standing, start)
    band = np.where(np.isfinite(arrival), np.where(np.isfinite(arrival), arrival, 0) // band_s, -1).astype(int)
    regions = _regions(band)
    count = int(regions.max())
    ends = _join(regions, band)
    passable = np.unique(_touching(regions, band)[:, 0])  # regions with something beyond them
    graph: nx.MultiGraph = nx.MultiGraph()
    graph.add_nodes_from(ends[1:, 0].tolist())
    graph.add_edges_from(ends[passable].tolist())
    root = int(ends[regions[start], 0])
    seen = _in_view(explorers, regions, count)
    credit: dict[int, set[int]] = {node: set() for node in graph}
    for region in range(1, count + 1):
        credit[int(ends[region, 0])].update(seen[region])
    for region in passable.tolist():
        credit[int(ends[region, 1])].update(seen[region])
    late = np.where(np.isfinite(arrival), arrival, 0.0) % band_s > (1 - _LEAVING) * band_s
    leaving = np.where(late, regions, 0)
    places = {root: spawn}
    for region in sorted(passable.tolist(), key=lambda r: float(world.clearance_m[leaving == r].max(initial=0.0))):
        rows, cols = np.nonzero(leaving == region if (leaving == region).any() else regions == region)
        best = int(world.clearance_m[rows, cols].argmax())
        places[int(ends[region, 1])] = world.origin_m + (np.array([cols[best], rows[best]]) + 0.5) * world.cell_m
    kept = {node: np.array(sorted(cells), dtype=int) for node, cells in credit.items()}
    return TimeNetwork(graph, root, band_s, kept, places | {root: spawn}, standing, arrival)


def _regions(band: np.ndarray) -> np.ndarray:
    """Return the connected parts of every band, numbered from 1; 0 where no robot can be."""
    regions = np.zeros(band.shape, dtype=int)
    for level in range(band.max() + 1):
        found, _ = label(band == level, structure=np.ones((3, 3)))
        regions[found > 0] = found[found > 0] + regions.max()
    return regions


def _arrival(explorers: Explorers, standing: np.ndarray, start: tuple[int, int]) -> np.ndarray:
    """Return the least time, s, in which a robot can come to each cell; infinite where it cannot."""
    world, task = explorers.world, explorers.task
    east = world.origin_m[0] + (np.arange(standing.shape[1]) + 0.5) * world.cell_m
    speed = top_speed_mps(world, task, east)
    slowness = np.broadcast_to(world.cell_m / speed, standing.shape)
    number = np.full(standing.shape, -1)
    number[standing] = np.arange(standing.sum())
    ways = []
    for i, j in _STEPS:
        ours, theirs = _shifted(number, i, j), _shifted(number, -i, -j)
        both = (ours >= 0) & (theirs >= 0)
        cost = np.hypot(i, j) * (_shifted(slowness, i, j)[both] + _shifted(slowness, -i, -j)[both]) / 2
        ways.append((ours[both], theirs[both], cost))
    row, col, cost = (np.concatenate(part) for part in zip(*ways, strict=True))
    graph = coo_matrix((cost, (row, col)), shape=(standing.sum(),) * 2).tocsr()
    times = np.full(standing.shape, np.inf)
    times[standing] = dijkstra(graph, indices=number[start]) / _METRIC
    return times


def _shifted(grid: np.ndarray, i: int, j: int) -> np.ndarray:
    """Return the part of a grid whose cells have a neighbour (i, j) away; with (-i, -j) those neighbours."""
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
    """Return the nodes (regions + 1, 2) at the near and the far side of every region; what touches shares a node."""
    count = int(regions.max())
    sides = nx.utils.UnionFind(range(2 * count + 2))
    for below, above in _touching(regions, band).tolist():
        sides.union(2 * below + 1, 2 * above)
    return np.array([[sides[2 * region], sides[2 * region + 1]] for region in range(count + 1)])


def _in_view(explorers: Explorers, regions: np.ndarray, count: int) -> list[np.ndarray]:
    """Return the reachable coverage cells (flat indices) that beams from anywhere in each region may cross."""
    world, grid = explorers.world, explorers.grid
    far = explorers.task.range_m[1] + _SAMPLE_M / np.sqrt(2)
    open_ = binary_dilation(world.clearance_m > 0, iterations=round(_SURFACE_M / world.cell_m))
    every = max(1, round(_SAMPLE_M / world.cell_m))
    picked = np.zeros_like(regions, dtype=bool)
    picked[::every, ::every] = True
    rows, cols = np.nonzero((regions > 0) & picked)
    lost = np.setdiff1d(np.arange(1, count + 1), regions[rows, cols])  # regions that the sampling missed
    for region in lost.tolist():
        row, col = np.argwhere(regions == region)[0]
        rows, cols = np.append(rows, row), np.append(cols, col)
    angle = np.linspace(0, 2 * np.pi, _RAYS, endpoint=False)
    steps = np.arange(0.0, far + _MARCH_M, _MARCH_M)
    offsets = np.stack([np.sin(angle), np.cos(angle)], axis=-1)[:, None, :] * steps[:, None]  # (rays, steps, 2): y, x
    reachable = grid.reachable.ravel()
    seen: list[set[int]] = [set() for _ in range(count + 1)]
    for row, col in zip(rows.tolist(), cols.tolist(), strict=True):
        place = world.origin_m[::-1] + (np.array([row, col]) + 0.5) * world.cell_m
        points = place + offsets
        at = np.floor((points - world.origin_m[::-1]) / world.cell_m).astype(int)
        inside = ((at >= 0) & (at < open_.shape)).all(axis=-1)
        at[~inside] = 0
        clear = np.logical_and.accumulate(open_[at[..., 0], at[..., 1]] & inside, axis=1)
        cell = np.floor((points[clear] - grid.origin_m[::-1]) / grid.cell_m).astype(int)
        within = ((cell >= 0) & (cell < grid.reachable.shape)).all(axis=-1)
        flat = np.unique(np.ravel_multi_index(cell[within].T, grid.reachable.shape))
        seen[regions[row, col]].update(flat[reachable[flat]].tolist())
    return [np.array(sorted(cells), dtype=int) for cells in seen]
