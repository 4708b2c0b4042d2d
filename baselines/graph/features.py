"""What the network is told of a decision: numbers of each cluster of the frontier, and the ways between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from baselines.explorers.graph_explorer import Situation
from baselines.explorers.own_map import FINE, ROCK, UNKNOWN, OwnMap

MOST = 12  # clusters: the nearest ones, as the tours of the classical explorers take
_BOX_CELLS = 3  # half a side of the square round a goal that is looked at
_BEYOND_M = 6.0  # behind the goal, in the direction in which the robot arrives
_UNREACHED_M = 200.0

NAMES = (
    "path", "path_log", "path_near", "rank", "behind_the_nearest", "cells", "unknown", "seen", "present", "age",
    "first_turn_cos", "first_turn_sin", "bearing_cos", "bearing_sin", "apart", "detour", "next_cluster",
    "near_clusters",
    "clearance", "degree", "rock", "few_cells", "frontier_near", "unknown_beyond",
    "time_left", "clusters", "still", "held", "cells_in_all", "seen_in_all",
)  # fmt: skip
STUBS = slice(NAMES.index("clearance"), NAMES.index("unknown_beyond") + 1)  # what tells dead ends from drifts


@dataclass(frozen=True)
class Context:
    """What a decision depends on beside the situation.

    Attributes
    ----------
    own : OwnMap
    pose : (3,)
        x, y, m, and yaw, rad.
    time_left_s : float
    still_s : float
        Since the robot was a metre away from where it is, or took its present goal, whichever is later.
    held_s : float
        Since the present goal's cluster was chosen.
    """

    own: OwnMap
    pose: np.ndarray
    time_left_s: float
    still_s: float
    held_s: float


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
    """Return what the network is told of a situation."""
    clusters = np.argsort(situation.costs, kind="stable")[:MOST]
    if situation.present >= 0 and situation.present not in clusters:
        clusters[-1] = situation.present
    goals, count = situation.goals[clusters], len(clusters)
    graph, pose = situation.graph, context.pose
    lengths, before = graph.costs_from(np.append(situation.robot, goals))
    apart = np.minimum(lengths[1:, goals], _UNREACHED_M)
    cost = np.minimum(lengths[0, goals], _UNREACHED_M)
    ends = [_ends(before[0], goal) for goal in goals.tolist()]
    first, last = graph.places[[e[0] for e in ends]], graph.places[[e[1] for e in ends]]
    places = graph.places[goals]
    straight = np.linalg.norm(places - pose[:2], axis=1)
    turn, bearing = _bearings(first - pose[:2]) - pose[2], _bearings(places - pose[:2]) - pose[2]
    beyond = places + _BEYOND_M * _unit(places - last)
    box, far = _shares(context.own, places), _shares(context.own, beyond)
    others = np.sort(apart + 1e3 * np.eye(count), axis=1)
    sizes, present = situation.sizes[clusters], clusters == situation.present
    everywhere = np.array([
        context.time_left_s / 600, len(situation.goals) / MOST, min(context.still_s / 10, 1.0),
        0.0, situation.sizes.sum() / 50, context.own.seen.sum() / 1000,
    ])  # fmt: skip
    common = np.tile(everywhere, (count, 1))
    common[:, 3] = present * min(context.held_s / 10, 3.0)
    own = np.column_stack([
        cost / 20, np.log1p(cost), np.exp(-cost / 10), np.arange(count) / MOST, (cost - cost.min()) / 10,
        sizes / 8, box[:, 0], box[:, 1], present, np.log1p(situation.ages[clusters] / 100),
        np.cos(turn), np.abs(np.sin(turn)), np.cos(bearing), np.abs(np.sin(bearing)), straight / 20,
        straight / np.maximum(cost, 1.0), np.minimum(others[:, 0], 40) / 20, np.minimum(others[:, :3], 40).mean(1) / 20,
        _clearance(context.own, places) / 3, _degrees(situation, goals) / 8, box[:, 2], sizes <= 3,
        (apart < 8).sum(axis=1) / 4, far[:, 0],
    ])  # fmt: skip
    tokens = np.clip(np.hstack([own, common]), -5.0, 5.0).astype(np.float32)
    return Scene(clusters, tokens, apart.astype(np.float32))


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


def _shares(own: OwnMap, places: np.ndarray) -> np.ndarray:
    """Return the shares (k, 3) of unknown, seen and rock cells in squares round places (k, 2) m."""
    row, col = own.at(places, own.cell_m)
    around = np.arange(-_BOX_CELLS, _BOX_CELLS + 1)
    rows, cols = row[:, None, None] + around[:, None], col[:, None, None] + around
    inside = (rows >= 0) & (cols >= 0) & (rows < own.seen.shape[0]) & (cols < own.seen.shape[1])
    at = np.where(inside, rows, 0), np.where(inside, cols, 0)
    middle = own.fine[at[0] * FINE + FINE // 2, at[1] * FINE + FINE // 2]
    unknown = ~inside | (middle == UNKNOWN)
    seen, rock = inside & own.seen[at], inside & (middle == ROCK)
    return np.stack([share.mean(axis=(1, 2)) for share in (unknown, seen, rock)], axis=1)


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
