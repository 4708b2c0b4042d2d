"""What the network gets of a decision: numbers of each cluster of the frontier, and the ways between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import dijkstra

from baselines.explorers.graph_explorer import Situation
from baselines.explorers.maps.own_map import FINE, ROCK, UNKNOWN, OwnMap

MOST = 16  # clusters: the nearest ones
_BOX_CELLS = 3  # half a side of the square round a goal that is looked at
_WIDE_CELLS = (1, 5, 9)  # the same of other squares
_BEYOND_M = 6.0  # behind the goal, in the direction in which the robot arrives
_FAR_BEYOND_M = (14.0, 24.0)
_BESIDE_M = 8.0  # to the left and to the right of the place beyond
_APART_M = 40.0  # the greatest path length between clusters that is told
_WEST_M = 20.0  # to the west or to the east of the robot: farther does not count more
_KNOWN_M = 20.0  # unit of the way from a goal to the nearest measurement of the floor
_UNREACHED_M = 200.0
_LEAST_SHARE = 0.2  # of the commanded speed: less was measured at an obstacle

NAMES = (
    "path", "path_log", "path_near", "rank", "behind_the_nearest", "cells", "unknown", "seen", "present", "age",
    "first_turn_cos", "first_turn_sin", "bearing_cos", "bearing_sin", "apart", "detour", "next_cluster",
    "near_clusters", "from_start",
    "unknown_within_3_m", "unknown_within_11_m", "unknown_within_19_m",
    "seen_within_3_m", "seen_within_11_m", "seen_within_19_m",
    "clearance", "degree", "rock", "few_cells", "frontier_near", "unknown_beyond", "unknown_beyond_14_m",
    "unknown_beyond_24_m", "unknown_beside", "unknown_beside_least",
    "floor_here", "floor_at_goal", "floor_best", "floor_known", "slow_path", "firmer_west",
    "time_left", "clusters", "still", "held", "cells_in_all", "seen_in_all",
)  # fmt: skip
STUBS = slice(NAMES.index("clearance"), NAMES.index("unknown_beside_least") + 1)  # what tells dead ends from drifts
FLOOR = slice(NAMES.index("floor_here"), NAMES.index("firmer_west") + 1)  # what tells how fast robots drive where


@dataclass(frozen=True)
class Context:
    """What a decision depends on beside the situation.

    Attributes
    ----------
    seen : int
        Coverage cells that the robot has seen.
    pose : (3,)
        x, y, m, and yaw, rad.
    start : (2,) m
        Where the robot was first.
    time_left_s : float
    still_s : float
        Since the robot was a metre away from where it is, or took its present goal, whichever is later.
    held_s : float
        Since the present goal's cluster was chosen.
    floor : (m, 3)
        Where the robot has measured its speed, x, y, m, and the share of the commanded speed that it reached.
    """

    seen: int
    pose: np.ndarray
    start: np.ndarray
    time_left_s: float
    still_s: float
    held_s: float
    floor: np.ndarray


@dataclass(frozen=True)
class Scene:
    """What the network takes.

    Attributes
    ----------
    clusters : (k,) int
        Indices into the situation's clusters, nearest first.
    tokens : (k, len(NAMES)) float32
    apart_m : (k, k) float32
        Path lengths between the goals.
    """

    clusters: np.ndarray
    tokens: np.ndarray
    apart_m: np.ndarray


def describe(situation: Situation, context: Context) -> Scene:
    """Return what the network gets of a situation."""
    clusters = np.argsort(situation.costs, kind="stable")[:MOST]
    if situation.present >= 0 and situation.present not in clusters:
        clusters[-1] = situation.present
    goals, count = situation.goals[clusters], len(clusters)
    graph, pose = situation.graph, context.pose
    lengths, before = graph.costs_from([situation.robot])
    near = dijkstra(graph.links, directed=False, indices=goals, limit=_APART_M)
    apart = np.minimum(near[:, goals], _APART_M)
    cost = np.minimum(lengths[0, goals], _UNREACHED_M)
    ends = [_ends(before[0], goal) for goal in goals.tolist()]
    first, last = graph.places[[e[0] for e in ends]], graph.places[[e[1] for e in ends]]
    places = graph.places[goals]
    straight = np.linalg.norm(places - pose[:2], axis=1)
    turn, bearing = _bearings(first - pose[:2]) - pose[2], _bearings(places - pose[:2]) - pose[2]
    onward = _unit(places - last)
    beyond, beside = places + _BEYOND_M * onward, _BESIDE_M * onward[:, ::-1] * [-1.0, 1.0]
    ground = GroundAbout(graph.maps(goals))
    unknown, seen, rock = ground.shares(places, _BOX_CELLS)
    wide = [ground.shares(places, half) for half in _WIDE_CELLS]
    far = [ground.shares(places + ahead * onward, _BOX_CELLS)[0] for ahead in _FAR_BEYOND_M]
    sides = np.sort([ground.shares(beyond + side * beside, _BOX_CELLS)[0] for side in (1.0, -1.0)], axis=0)
    others = np.sort(apart + 1e3 * np.eye(count), axis=1)
    sizes, present = situation.sizes[clusters], clusters == situation.present
    everywhere = np.array([
        context.time_left_s / 600, len(situation.goals) / MOST, min(context.still_s / 10, 1.0),
        0.0, situation.sizes.sum() / 50, context.seen / 1000,
    ])  # fmt: skip
    common = np.tile(everywhere, (count, 1))
    common[:, 3] = present * min(context.held_s / 10, 3.0)
    own = np.column_stack([
        cost / 20, np.log1p(cost), np.exp(-cost / 10), np.arange(count) / MOST, (cost - cost.min()) / 10,
        sizes / 8, unknown, seen, present, np.log1p(situation.ages[clusters] / 100),
        np.cos(turn), np.abs(np.sin(turn)), np.cos(bearing), np.abs(np.sin(bearing)), straight / 20,
        straight / np.maximum(cost, 1.0), others[:, 0].clip(max=_APART_M) / 20,
        others[:, :3].clip(max=_APART_M).mean(axis=1) / 20,
        np.linalg.norm(places - context.start, axis=1) / 100,
        *(shares[0] for shares in wide), *(shares[1] for shares in wide),
        ground.clearance(places) / 3, _degrees(situation, goals) / 8, rock, sizes <= 3,
        (apart < 8).sum(axis=1) / 4, ground.shares(beyond, _BOX_CELLS)[0], *far, sides[1], sides[0],
        *_floor(context, places, cost),
    ])  # fmt: skip
    tokens = np.clip(np.hstack([own, common]), -5.0, 5.0).astype(np.float32)
    return Scene(clusters, tokens, apart.astype(np.float32))


def _floor(context: Context, places: np.ndarray, cost: np.ndarray) -> np.ndarray:
    """Return what the robot's measurements of the floor say of goals (k, 2) m at costs (k,) m: (6, k).

    Shares of the commanded speed here, at the measurement nearest to each goal, and the best one; how far that
    measurement is from the goal; the cost as if all floor were dry; and how far west the goal is, -1 to 1, times the
    share that is missing here: floors are dry in the west, and nothing draws a robot there that drives on dry floor.
    """
    one = np.ones(len(places))
    if not len(context.floor):
        return np.stack([one, one, one, 2.0 * one, cost / 20, 0.0 * one])
    away = np.linalg.norm(places[:, None] - context.floor[:, :2], axis=2)
    nearest, shares = away.argmin(axis=1), np.clip(context.floor[:, 2], _LEAST_SHARE, 1.0)
    here, there = shares[-1] * one, shares[nearest]
    known = np.minimum(away.min(axis=1) / _KNOWN_M, 2.0)
    west = np.clip((context.pose[0] - places[:, 0]) / _WEST_M, -1.0, 1.0) * (1.0 - here)
    return np.stack([here, there, shares.max() * one, known, cost * (1 / here + 1 / there) / 40, west])


def _ends(before: np.ndarray, goal: int) -> tuple[int, int]:
    """Return the second node of the way to a goal, or the third of a longer one, and the last before the goal."""
    way = [goal]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    return way[max(len(way) - 3, 0)], way[min(1, len(way) - 1)]


def _bearings(along: np.ndarray) -> np.ndarray:
    return np.arctan2(along[:, 1], along[:, 0])


def _unit(along: np.ndarray) -> np.ndarray:
    return along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)


class GroundAbout:
    """What maps show about places (k, 2) m, each on a map of its own: squares, by sums over the maps, and rock."""

    def __init__(self, maps: list[OwnMap]) -> None:
        """Take the map (k,) of each place; beyond it all is unknown."""
        of = {id(own): own for own in maps}
        self._rows = [(own, np.array([k for k, other in enumerate(maps) if other is own])) for own in of.values()]
        self._sums = [_sums(own) for own, _ in self._rows]

    def shares(self, places: np.ndarray, half: int) -> np.ndarray:
        """Return the shares (3, k), unknown, seen and rock, of squares of 2 half + 1 cells round places (k, 2) m."""
        found = np.empty((3, len(places)))
        for (own, rows), sums in zip(self._rows, self._sums, strict=True):
            found[:, rows] = _shares(own, sums, places[rows], half)
        return found

    def clearance(self, places: np.ndarray) -> np.ndarray:
        """Return the distance (k,) m, at most 3, from places (k, 2) m to known rock."""
        found = np.empty(len(places))
        for own, rows in self._rows:
            found[rows] = _clearance(own, places[rows])
        return found


def _sums(own: OwnMap) -> np.ndarray:
    """Return the sums (3, rows + 1, cols + 1) of what is known, seen and rock over a map's cells before each."""
    middle = own.fine[FINE // 2 :: FINE, FINE // 2 :: FINE]
    layers = np.stack([middle != UNKNOWN, own.seen, middle == ROCK])
    sums = np.zeros((3, *np.add(own.seen.shape, 1)))
    sums[:, 1:, 1:] = layers.cumsum(axis=1, dtype=float).cumsum(axis=2)
    return sums


def _shares(own: OwnMap, sums: np.ndarray, places: np.ndarray, half: int) -> np.ndarray:
    row, col = own.at(places, own.cell_m)
    rows, cols = own.seen.shape
    low, high = np.clip(row - half, 0, rows), np.clip(row + half + 1, 0, rows)
    left, right = np.clip(col - half, 0, cols), np.clip(col + half + 1, 0, cols)
    inside = sums[:, high, right] - sums[:, low, right] - sums[:, high, left] + sums[:, low, left]
    inside /= (2 * half + 1) ** 2
    inside[0] = 1.0 - inside[0]
    return inside


def _clearance(own: OwnMap, places: np.ndarray) -> np.ndarray:
    """Return the distance (k,) m, at most 3, from places (k, 2) m to known rock."""
    reach = round(3.0 / own.fine_m)
    steps = np.arange(-reach, reach + 1)
    apart = np.hypot(steps[:, None], steps) * own.fine_m
    row, col = own.at(places, own.fine_m)
    rows = np.clip(row[:, None, None] + steps[:, None], 0, own.fine.shape[0] - 1)
    cols = np.clip(col[:, None, None] + steps, 0, own.fine.shape[1] - 1)
    return np.where(own.fine[rows, cols] == ROCK, apart, 3.0).min(axis=(1, 2)).clip(max=3.0)


def _degrees(situation: Situation, goals: np.ndarray) -> np.ndarray:
    """Return how many links each goal (k,) has."""
    links = situation.graph.links
    count = np.diff(links.indptr) + np.bincount(links.indices, minlength=links.shape[0])
    return count[goals]
