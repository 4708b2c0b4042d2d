"""The network of driving times of a mine that is one volume: over floor spans, by lengths in space."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import networkx as nx
import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra

from baselines.base.errors import BaselineError
from baselines.oracle.bands import cut_into_bands, joined_pairs
from baselines.oracle.bound import Walk
from baselines.oracle.network import _EXIT_PART, _METRIC, _SINK_M, TimeNetwork
from baselines.oracle.problem import CoverageProblem
from baselines.oracle.span_views import cells_in_view
from baselines.oracle.tour import _NEAR_ROCK_M, _NEAR_ROCK_PENALTY
from minexplore.floors.volume_arrays import FacetLabel, FloorSpans
from minexplore.physics.robot import FASTEST_FALL_MPS
from minexplore.task import TaskParams
from minexplore.volume.standing import wide_pairs
from minexplore.world import World

_HALF_TURN = 1 / 6  # tangent of half the angle between (1, 0) and (3, 1), at most; see `_STEPS`
# Speed down a slope over the commanded one, by the slope over the floor's friction: the fastest of 12 robots on slopes
# of 13, 20, 30 and 36 % in each zone. From 0.9 on robots slide faster and faster.
_SLIP = ((0.0, 0.25, 0.36, 0.55, 0.7, 0.9), (1.02, 1.04, 1.06, 1.25, 1.5, 1.8))
_FALL_MPS = FASTEST_FALL_MPS + 1.0  # falling robots are slowed at each control step of 0.1 s, in which they gain 1 m/s
_GRAVITY = 9.81
_STEEPEST, _STEP_M = 0.364, 0.05  # rise over run of floors that robots drive on, and the step that they take besides
_SLIVER_M2 = 1e-3  # of a floor's facet, whose slope says nothing


@dataclass(frozen=True)
class SpanLinks:
    """The spans that a robot may be on (a mask, s), pairs (n, 2) of their numbers in it, and the pairs' lengths, m.

    `is_fall` are pairs between which no robot drives: it slides or falls. They are linked both ways, so that times
    differ by no more than a way takes in either direction.
    """

    standing: np.ndarray
    pairs: np.ndarray
    length_m: np.ndarray
    is_fall: np.ndarray

    def graph(self, weight: np.ndarray) -> csr_matrix:
        """Return the pairs as a graph: lengths times the mean of the spans' weights (s,); falls by their own time."""
        one, two = self.pairs.T
        own = weight[self.standing]
        cost = np.maximum(self.length_m, 1e-6) * np.where(self.is_fall, 1.0, (own[one] + own[two]) / 2)
        count = int(self.standing.sum())
        return csr_matrix(coo_matrix((cost, (one, two)), shape=(count, count)))


def network_over_spans(problem: CoverageProblem, band_s: float) -> TimeNetwork:
    """Return what `time_network` does, of a mine that is one volume.

    A way's length is that in space, along the floors. A robot may fall wherever free space is over a lower floor, at
    4 m/s at most. `standing`, `arrival_s` are of spans (s,); `places` are numbers of spans. A bound is higher by what
    is not known of robots that slide, never lower.

    Parameters
    ----------
    problem : CoverageProblem
    band_s : float
    """
    spans = spans_of(problem.world)
    links, (start,), times = arrival_over_spans(problem, np.array(problem.world.record["spawn"]["anchor_m"])[None])
    numbers = np.flatnonzero(links.standing)
    bands = cut_into_bands(times, links.pairs, band_s)
    regions, ends = bands.regions, bands.ends
    is_reached = np.isfinite(times)
    late = is_reached & (np.where(is_reached, times, 0.0) % band_s > (1 - _EXIT_PART) * band_s)
    clearance = spans.clearance_m[numbers]
    places = {}
    for region in sorted(bands.passable.tolist(), key=lambda r: float(clearance[regions == r].max())):
        own = np.flatnonzero((regions == region) & late)
        own = own if len(own) else np.flatnonzero(regions == region)
        node = int(ends[region, 1])
        places[node] = numbers[[own[clearance[own].argmax()]]]
    root = int(ends[regions[start], 0])
    arrival = np.full(len(links.standing), np.inf)
    arrival[numbers] = times
    found = bands.network(start, cells_in_view(problem, numbers, regions))
    return replace(found, places={**places, root: numbers[[start]]}, standing=links.standing, arrival_s=arrival)


def arrival_over_spans(problem: CoverageProblem, starts_m: np.ndarray) -> tuple[SpanLinks, list[int], np.ndarray]:
    """Return where a robot can be, where it starts, and the least time (k,), s, to each such span from a start.

    Starts (n, 3) m are in the mine frame; those returned are indices of the nearest of the k spans to stand on. A time
    is infinite where no way leads.
    """
    spans = spans_of(problem.world)
    links = span_links(spans, problem.robot.radius_m - _SINK_M)
    places = spans.roomiest_m[links.standing]
    starts = [int(np.linalg.norm(places - start, axis=1).argmin()) for start in starts_m]
    graph = links.graph(slowness(problem.world, problem.task))
    times = dijkstra(graph, directed=False, indices=starts, min_only=True) / metric_of(spans)
    return links, starts, times


def spans_of(world: World) -> FloorSpans:
    """Return the floors of a world that is one volume."""
    assert world.volume is not None
    return world.volume.spans


def span_links(spans: FloorSpans, clearance_m: float) -> SpanLinks:
    """Return the spans with at least a clearance, or a floor too steep to stand on, and the pairs that lead on.

    A pair leads on if the free spaces over both floors have a height in common that is over both floors. Between
    floors that rise by the steepest slope at most a robot drives; else it falls.
    """
    standing = (spans.clearance_m >= clearance_m) | (spans.storey < 0)
    numbers = np.flatnonzero(standing)
    floor = spans.floor_m[numbers]
    pairs, length = joined_pairs(spans.column[numbers], spans.row[numbers], floor, floor + spans.headroom_m[numbers])
    (one, two), run = pairs.T, length * spans.cell_m
    rise = np.abs(floor[one] - floor[two])
    steep = rise > _steepest(spans) * run
    length = np.where(steep, rise / _FALL_MPS, np.hypot(run, rise))
    return SpanLinks(standing, pairs, length, steep)


def _steepest(spans: FloorSpans) -> float:
    """Return the rise over run between columns up to which a robot may drive: two floors of 0.364 that turn, a step."""
    return _STEEPEST + _STEP_M / spans.cell_m


def metric_of(spans: FloorSpans) -> float:
    """Return how many times as long as the straight line a path in the directions of `_STEPS` is, at most.

    On a slope s the angle between two directions grows: the tangent of its half by sqrt(1 + s^2) at most.
    """
    return max(_METRIC, float(np.sqrt(1 + (1 + _steepest(spans) ** 2) * _HALF_TURN**2)))


def slowness(world: World, task: TaskParams) -> np.ndarray:
    """Return the least time a metre (s,), s/m along the floor, of a robot on each span.

    A robot slides as fast as the steepest floor of its zone lets it. Without friction it gains the speed of a fall.
    """
    assert world.volume is not None
    facets = world.volume.facets
    floor = (facets.label == FacetLabel.FLOOR) & (np.linalg.norm(facets.normals, axis=1) > 2 * _SLIVER_M2)
    normal, corners = facets.normals[floor], facets.vertices[facets.faces[floor]]
    slope = np.hypot(normal[:, 0], normal[:, 1]) / np.maximum(-normal[:, 2], 1e-9)
    zones = world.active_zones(task.terrain)
    west, east = world.zones_at(corners[:, :, 0].min(axis=1)), world.zones_at(corners[:, :, 0].max(axis=1))
    steep = np.zeros(len(zones))
    for number in (west, east):
        np.maximum.at(steep, number, slope)
    commanded = task.max_forward_mps * np.array([zone.command_scale for zone in zones])
    grip = steep / np.array([max(zone.friction, 1e-6) for zone in zones])
    fall_m = float(np.ptp(corners[:, :, 2]))
    gained = np.sqrt((_SLIP[1][-1] * commanded) ** 2 + 2 * _GRAVITY * fall_m)
    sliding = np.minimum(gained, _FALL_MPS * np.sqrt(1 + 1 / np.maximum(steep, 1e-9) ** 2))
    most = np.where(grip < _SLIP[0][-1], commanded * np.interp(grip, *_SLIP), sliding)
    return np.asarray(1 / most[world.zones_at(world.volume.spans.places_m[:, 0])])


def tour_over_spans(network: TimeNetwork, walk: Walk, world: World) -> np.ndarray:
    """Return what `plan_tour` does, over the floors of a volume: a path (n, 2), m, mine frame, that never falls.

    It goes from roomiest place to roomiest place, where the way between has room.

    Raises
    ------
    BaselineError
        If the walk is empty or not connected, or a place of it is only reached by a fall.
    """
    every: nx.MultiDiGraph = nx.MultiDiGraph(walk.passages)
    every.add_node(network.root)
    rings = nx.node_connected_component(every.to_undirected(), network.root)  # passages to spare may form others
    passages = every.subgraph(rings)
    if not passages.size() or not nx.has_eulerian_path(passages, network.root):
        raise BaselineError("oracle: the solver found no connected walk; give it more time (--limit)")
    spans = spans_of(world)
    radius_m = float(spans.clearance_m[network.standing & (spans.storey >= 0)].min())
    pairs = wide_pairs(spans, _STEEPEST, _STEP_M, 0.0, radius_m)
    pairs = pairs[network.standing[pairs].all(axis=1)]
    number = np.cumsum(network.standing) - 1
    length = np.linalg.norm(np.diff(spans.roomiest_m[pairs], axis=1)[:, 0], axis=1)
    driven = SpanLinks(network.standing, number[pairs], length, np.zeros(len(pairs), bool))
    nearness = np.clip((_NEAR_ROCK_M - spans.clearance_m) / _NEAR_ROCK_M, 0, 1)
    graph = driven.graph(1.0 + _NEAR_ROCK_PENALTY * nearness**2)
    nodes = [network.root, *(v for _, v in nx.eulerian_path(passages, network.root))]
    way = [int(number[network.places[network.root][0]])]
    for here, there in itertools.pairwise(nodes):
        start, end = (int(number[network.places[node][0]]) for node in (here, there))
        before = dijkstra(graph, directed=False, indices=way[-1], return_predecessors=True)[1]
        if before[end] < 0 and end != start:
            continue  # over a fall: the tour leaves it out
        part = [end]
        while part[-1] != way[-1]:
            part.append(int(before[part[-1]]))
        way.extend(part[-2::-1])
    return _spaced(spans.roomiest_m[np.flatnonzero(network.standing)[way], :2], spans.cell_m)


def _spaced(corners: np.ndarray, spacing_m: float) -> np.ndarray:
    """Return places (n, 2) m along a line, about so far apart."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    at = np.linspace(0.0, along[-1], int(along[-1] / spacing_m) + 2)
    return np.column_stack([np.interp(at, along, corners[:, axis]) for axis in (0, 1)])
