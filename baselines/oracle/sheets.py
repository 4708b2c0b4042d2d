"""The network of driving times of a mine with heights: over all sheets, across their seams, by lengths in space."""

from __future__ import annotations

import itertools

import networkx as nx
import numpy as np
import shapely
from scipy.ndimage import binary_dilation
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from baselines.base.errors import BaselineError
from baselines.oracle.bound import Walk
from baselines.oracle.network import (
    _EXIT_PART,
    _METRIC,
    _SINK_M,
    _STEPS,
    TimeNetwork,
    _credit,
    _places,
    _regions,
    _shifted,
    _touching,
)
from baselines.oracle.tour import _NEAR_ROCK_M, _NEAR_ROCK_PENALTY
from baselines.oracle.visibility import _MARCH_M, _RAYS, _SAMPLE_M, SURFACE_M, _samples
from minexplore.envs.robot_batch import RobotBatch
from minexplore.floors.floor import Floor
from minexplore.task import TaskParams
from minexplore.world import World

_HALF_TURN = 1 / 6  # tangent of half the angle between (1, 0) and (3, 1), at most; see `_STEPS`
# Speed down a slope over the commanded one, by the slope over the floor's friction: the fastest of 12 robots on slopes
# of 13, 20, 30 and 36 % in each zone. From 0.9 on robots slide faster and faster.
_SLIP = ((0.0, 0.25, 0.36, 0.55, 0.7, 0.9), (1.02, 1.04, 1.06, 1.25, 1.5, 1.8))
_GRAVITY = 9.81
_BESIDE_M = 0.5  # of a seam: cells that are linked with the other sheet's
_LEAN = 0.06  # rise per metre that a robot leans by more than its floor: 3.3 deg on its castors in 95 % of steps
_LAST_M = 1.0  # of rise beyond a beam's: a floor and its roof change within a cell


def network_over_sheets(batch: RobotBatch, band_s: float) -> TimeNetwork:
    """Return what `time_network` does, of a mine with heights.

    A way's length is that in space, along the floor. Cells of two sheets beside their seam are linked, and what a
    link may be too long by is taken off. See `metric_of` for slopes. A bound is higher by that, never lower.

    Parameters
    ----------
    batch : RobotBatch
        Holds world, task, robot and the reachable coverage cells.
    band_s : float
    """
    world = batch.world
    standing = world.clearance_m >= batch.robot.radius_m - _SINK_M
    spawn = np.array(world.record["spawn"]["anchor_m"])
    start = tuple(np.floor((spawn - world.origin_m) / world.cell_m).astype(int)[::-1].tolist())
    across = seam_links(world, standing)
    speed = steep_speed_mps(world, batch.task)
    arrival = np.full(standing.shape, np.inf)
    lengths = links_in_space(world, standing, across, 1 / speed)
    number = np.cumsum(standing).reshape(standing.shape) - 1
    arrival[standing] = dijkstra(lengths, directed=False, indices=number[start]) / metric_of(world.floor)
    band = np.where(np.isfinite(arrival), np.where(np.isfinite(arrival), arrival, 0.0) // band_s, -1).astype(int)
    regions = _merge_over(_regions(band), band, across)
    touching = _touching_over(regions, band, across)
    ends = _join_over(int(regions.max()), touching)
    passable = np.unique(touching[:, 0])
    graph: nx.MultiGraph = nx.MultiGraph()
    graph.add_nodes_from(ends[1:, 0].tolist())
    graph.add_edges_from(ends[passable].tolist())
    root = int(ends[regions[start], 0])
    reached_s = np.where(np.isfinite(arrival), arrival, 0.0)
    late = np.where(reached_s % band_s > (1 - _EXIT_PART) * band_s, regions, 0)
    places = _places(world, regions, late, {region: int(ends[region, 1]) for region in passable.tolist()})
    credit = _credit(cells_in_view(batch, regions), ends, passable, list(graph))
    return TimeNetwork(graph, root, band_s, credit, places | {root: spawn}, standing, arrival)


def steep_speed_mps(world: World, task: TaskParams) -> np.ndarray:
    """Return the mean speed (rows, columns), m/s along the floor, that no robot exceeds in the map's cells."""
    zones = world.active_zones(task.terrain)
    steep = np.tan(np.radians(world.floor.steepness_deg().max()))
    commanded = task.max_forward_mps * np.array([zone.command_scale for zone in zones])
    grip = steep / np.array([max(zone.friction, 1e-6) for zone in zones])
    fall_m = float(np.ptp(world.floor.vertices[:, 2]))
    sliding = np.sqrt((_SLIP[1][-1] * commanded) ** 2 + 2 * _GRAVITY * fall_m)
    most = np.where(grip < _SLIP[0][-1], commanded * np.interp(grip, *_SLIP), sliding)
    speed = np.full(world.clearance_m.shape, most.max())
    row, col = np.nonzero(world.clearance_m > 0)
    places = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
    speed[row, col] = most[world.zones_at(places[:, 0] - world.floor.offsets_at(places)[:, 0])]
    return speed


def metric_of(floor: Floor) -> float:
    """Return how many times as long as the straight line a path in the directions of `_STEPS` is, at most.

    On a slope s the angle between two directions grows: the tangent of its half by sqrt(1 + s^2) at most.
    """
    slope = np.tan(np.radians(floor.steepness_deg().max()))
    return max(_METRIC, float(np.sqrt(1 + (1 + slope**2) * _HALF_TURN**2)))


def _centres(world: World, cells: np.ndarray) -> np.ndarray:
    """Return the centres (n, 2) m, plan, of cells (n, 2), row and column."""
    return world.origin_m + (cells[:, ::-1] + 0.5) * world.cell_m


def seam_links(world: World, standing: np.ndarray) -> np.ndarray:
    """Return pairs (k, 2, 2) of cells, row and column, beside a seam and on its other side."""
    cells = np.argwhere(standing)
    tree = shapely.STRtree(shapely.points(_centres(world, cells)))
    floor, found = world.floor, [np.zeros((0, 2, 2), dtype=int)]
    for (one, two), corners in zip(*floor.seam_edges(), strict=True):
        ours, theirs = (tree.query(shapely.LineString(line), "dwithin", distance=_BESIDE_M) for line in corners)
        moved = _centres(world, cells[theirs]) - floor.offset_m[two] + floor.offset_m[one]
        apart = np.linalg.norm(_centres(world, cells[ours])[:, None] - moved, axis=2)
        a, b = np.nonzero(apart <= 2 * _BESIDE_M)
        found.append(np.stack([cells[ours[a]], cells[theirs[b]]], axis=1))
    return np.unique(np.concatenate(found), axis=0)


def links_in_space(world: World, standing: np.ndarray, across: np.ndarray, weight: np.ndarray) -> csr_matrix:
    """Return the links (n, n) between standing cells: lengths in space, m, times the mean of the cells' weights."""
    number = np.where(standing, np.cumsum(standing).reshape(standing.shape) - 1, -1)
    cells = np.argwhere(standing)
    places = _centres(world, cells)
    space = world.floor.fold(np.column_stack([places, np.zeros(len(places))]))
    pairs = []
    for i, j in _STEPS:
        ours, theirs = _shifted(number, i, j), _shifted(number, -i, -j)
        both = (ours >= 0) & (theirs >= 0)
        pairs.append(np.column_stack([ours[both], theirs[both]]))
    over = np.column_stack([number[tuple(across[:, k].T)] for k in (0, 1)])
    one, two = np.concatenate([*pairs, over]).T
    length = np.linalg.norm(space[one] - space[two], axis=1)
    length[len(length) - len(over) :] -= np.sqrt(2) * world.cell_m  # places within two cells stand for their centres
    flat = weight[standing]
    cost = np.maximum(length, 1e-6) * (flat[one] + flat[two]) / 2
    kept = one < two  # each pair comes twice; of the two orders the graph needs one
    low, high = np.minimum(one, two), np.maximum(one, two)
    kept |= np.arange(len(one)) >= len(one) - len(over)
    matrix = coo_matrix((cost[kept], (low[kept], high[kept])), shape=(len(cells),) * 2)
    return csr_matrix(matrix)


def _merge_over(regions: np.ndarray, band: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Return the regions, numbered anew, with those of one band on two sides of a seam as one."""
    one, two = (tuple(across[:, k].T) for k in (0, 1))
    same = (regions[one] > 0) & (regions[two] > 0) & (band[one] == band[two])
    count = int(regions.max()) + 1
    links = coo_matrix((np.ones(same.sum()), (regions[one][same], regions[two][same])), shape=(count, count))
    label = connected_components(links, directed=False)[1]
    return (label - label[0])[regions] if label[0] == 0 else regions


def _touching_over(regions: np.ndarray, band: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Return pairs (n, 2) of regions that touch, over seams too, the lower band first."""
    one, two = (tuple(across[:, k].T) for k in (0, 1))
    meet = (regions[one] > 0) & (regions[two] > 0) & (band[one] != band[two])
    a, b, upward = regions[one][meet], regions[two][meet], band[one][meet] < band[two][meet]
    over = np.column_stack([np.where(upward, a, b), np.where(upward, b, a)])
    return np.unique(np.concatenate([_touching(regions, band), over]), axis=0)


def _join_over(count: int, touching: np.ndarray) -> np.ndarray:
    """Return the nodes (regions + 1, 2) at the near and the far side of every region; touching ones share a node."""
    sides = nx.utils.UnionFind(range(2 * count + 2))
    for below, above in touching.tolist():
        sides.union(2 * below + 1, 2 * above)
    return np.array([[sides[2 * region], sides[2 * region + 1]] for region in range(count + 1)])


def cells_in_view(batch: RobotBatch, regions: np.ndarray) -> list[np.ndarray]:
    """Return what `visibility.cells_in_view` does, across seams.

    A view goes on in every sheet between whose floor and roof a beam can be: a robot's beams rise or fall by the
    steepest slope of the mine at most.
    """
    world, grid, floor = batch.world, batch.grid, batch.world.floor
    far, height_m = batch.task.range_m[1] + _SAMPLE_M / np.sqrt(2), float(world.record["height_m"])
    rise = np.tan(np.radians(floor.steepness_deg().max())) + _LEAN
    open_ = binary_dilation(world.clearance_m > 0, iterations=round(SURFACE_M / world.cell_m))
    level, tall_m = np.full(open_.shape, np.nan), np.full(open_.shape, height_m)
    cells, roof = np.argwhere(open_), floor.raised(height_m)
    level[open_] = floor.heights_at(_centres(world, cells))
    tall_m[open_] += floor.lifts_at(_centres(world, cells), height_m)
    angle = np.linspace(0, 2 * np.pi, _RAYS, endpoint=False)
    steps = np.arange(0.0, far + _MARCH_M, _MARCH_M)
    offsets = np.stack([np.cos(angle), np.sin(angle)], axis=-1)[:, None, :] * steps[:, None]  # (rays, steps, 2)
    reachable = grid.reachable.ravel()
    seen: list[set[int]] = [set() for _ in range(int(regions.max()) + 1)]
    for row, col in _samples(regions, max(1, round(_SAMPLE_M / world.cell_m))):
        place = _centres(world, np.array([[row, col]]))[0]
        sheet, eye = int(floor.sheets_at(place[None])[0]), level[row, col] + batch.robot.sensor_height_m
        clear, views = np.zeros(offsets.shape[:2], dtype=bool), []
        for other in range(len(floor.offset_m)):
            low, high = floor.spans_m[other, 0], roof.spans_m[other, 1]
            if eye + rise * far < low - _LAST_M or eye - rise * far > high + _LAST_M:
                continue
            points = place + offsets + floor.offset_m[other] - floor.offset_m[sheet]
            at = np.floor((points - world.origin_m) / world.cell_m).astype(int)[..., ::-1]
            inside = ((at >= 0) & (at < open_.shape)).all(axis=-1)
            at[~inside] = 0
            ground, tall = level[at[..., 0], at[..., 1]], tall_m[at[..., 0], at[..., 1]]
            with np.errstate(invalid="ignore"):
                meets = (eye + rise * steps > ground - _LAST_M) & (eye - rise * steps < ground + tall + _LAST_M)
            inside &= (
                open_[at[..., 0], at[..., 1]]
                & meets
                & (floor.sheets_at(points.reshape(-1, 2)) == other).reshape(inside.shape)
            )
            clear |= inside
            views.append((points, inside))
        clear = np.logical_and.accumulate(clear, axis=1)
        for points, inside in views:
            cell = np.floor((points[clear & inside] - grid.origin_m) / grid.cell_m).astype(int)[:, ::-1]
            within = ((cell >= 0) & (cell < grid.reachable.shape)).all(axis=-1)
            flat = np.unique(np.ravel_multi_index(tuple(cell[within].T), grid.reachable.shape))
            seen[regions[row, col]].update(flat[reachable[flat]].tolist())
    return [np.array(sorted(found), dtype=int) for found in seen]


def tour_over_sheets(network: TimeNetwork, walk: Walk, world: World) -> np.ndarray:
    """Return what `plan_tour` does, across seams: a path (n, 2), m, mine frame.

    Raises
    ------
    BaselineError
        If the walk is empty or not connected.
    """
    passages: nx.MultiDiGraph = nx.MultiDiGraph(walk.passages)
    if not walk.passages or not nx.has_eulerian_path(passages, network.root):
        raise BaselineError("oracle: the solver found no connected walk; give it more time (--limit)")
    nodes = [network.root, *(v for _, v in nx.eulerian_path(passages, network.root))]
    nearness = np.clip((_NEAR_ROCK_M - world.clearance_m) / _NEAR_ROCK_M, 0, 1)
    across = seam_links(world, network.standing)
    links = links_in_space(world, network.standing, across, 1.0 + _NEAR_ROCK_PENALTY * nearness**2)
    number = np.cumsum(network.standing).reshape(network.standing.shape) - 1
    cells = np.argwhere(network.standing)
    way = [_number_at(world, number, network.places[network.root])]
    for here, there in itertools.pairwise(nodes):
        start, end = (_number_at(world, number, network.places[node]) for node in (here, there))
        before = dijkstra(links, directed=False, indices=start, return_predecessors=True)[1]
        part = [end]
        while part[-1] != start:
            part.append(int(before[part[-1]]))
        way.extend(part[-2::-1])
    path = _centres(world, cells[way])
    return _spaced(world.floor.fold(np.column_stack([path, np.zeros(len(path))]))[:, :2], world.cell_m)


def _number_at(world: World, number: np.ndarray, place: np.ndarray) -> int:
    row, col = np.floor((place - world.origin_m) / world.cell_m).astype(int)[::-1]
    return int(number[row, col])


def _spaced(corners: np.ndarray, spacing_m: float) -> np.ndarray:
    """Return places (n, 2) m along a line, about so far apart."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    at = np.linspace(0.0, along[-1], int(along[-1] / spacing_m) + 2)
    return np.column_stack([np.interp(at, along, corners[:, axis]) for axis in (0, 1)])
