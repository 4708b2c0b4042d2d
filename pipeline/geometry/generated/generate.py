"""Procedural mines: plans of four styles, generated from a seed."""

from __future__ import annotations

import math
from itertools import pairwise

import networkx as nx
import numpy as np
import shapely
from shapely import LineString, MultiPolygon, Point
from shapely.geometry.base import BaseGeometry

from pipeline.geometry.generated.perturb import displace
from pipeline.geometry.outline.enclosure import as_polygons

Range = tuple[float, float]
_RIB_WAVE_M = 6.0  # walls of blasted drifts vary over about the length of a round and the width of the drift
_THIN_M = 1.5  # rock between drifts thinner than this would not stand and is removed
_STEP_M = 3.0  # distance between the stations of a winding passage


def generate_workings(
    style: str,
    rng: np.random.Generator,
    size_m: Range,
    width_m: Range,
    loops: float,
    dead_ends: float,
    rib_noise_m: float,
    pillar_m: float,
    spacing_m: float,
    wander: float,
) -> MultiPolygon:
    """Generate a mine's workings.

    Parameters
    ----------
    style : {"room_and_pillar", "drift_and_crosscut", "ramp", "cave"}
    rng : Generator
    size_m, width_m : (low, high)
        Range of the mine's side, and range of the drifts' widths, m.
    loops : float
        Share of the crosscuts that are driven in addition to a spanning tree.
    dead_ends : float
        Share of the possible dead ends that stay dead ends.
    rib_noise_m : float
        Standard deviation of the walls about their lines, m.
    pillar_m, spacing_m : float
        Side of a pillar (room and pillar), m; distance between drifts or between the ramp's straights, m.
    wander : float
        How much a cave's passages wind, in [0, 1].

    Returns
    -------
    shapely.MultiPolygon, m
        One polygon near the origin.
    """
    drawn = {
        "room_and_pillar": lambda: _rooms(rng, size_m, width_m, loops, dead_ends, pillar_m),
        "drift_and_crosscut": lambda: _on_lattice(rng, size_m, width_m, loops, dead_ends, spacing_m, jitter=0.15),
        "ramp": lambda: _ramp(rng, size_m, width_m, loops, dead_ends, spacing_m),
        "cave": lambda: _cave(rng, size_m, width_m, loops, dead_ends, wander),
    }[style]()
    rough = displace(shapely.union_all(drawn), rib_noise_m, _RIB_WAVE_M, rng)
    with np.errstate(divide="ignore", invalid="ignore"):  # GEOS divides by zero at some joins and takes another way
        stable = rough.buffer(_THIN_M / 2, join_style="mitre").buffer(-_THIN_M / 2, join_style="mitre")
    return as_polygons(stable)


def _rooms(
    rng: np.random.Generator, size_m: Range, width_m: Range, loops: float, dead_ends: float, pillar_m: float
) -> list[BaseGeometry]:
    width = rng.uniform(*width_m)
    return _on_lattice(rng, size_m, (width, width), loops, dead_ends, pillar_m + width, jitter=0.0)


def _on_lattice(
    rng: np.random.Generator,
    size_m: Range,
    width_m: Range,
    loops: float,
    dead_ends: float,
    spacing: float,
    jitter: float,
) -> list[BaseGeometry]:
    """Drive a random spanning tree of a lattice and a share of its other edges; extend a share of the dead ends."""
    east, north = (max(2, round(rng.uniform(*size_m) / spacing) + 1) for _ in range(2))
    lattice = nx.grid_2d_graph(east, north)
    for a, b in lattice.edges:
        lattice.edges[a, b]["weight"] = rng.random()
    driven: nx.Graph = nx.Graph(nx.minimum_spanning_tree(lattice))
    others = [edge for edge in lattice.edges if not driven.has_edge(*edge)]
    driven.add_edges_from(edge for edge in others if rng.random() < loops)
    for node in [n for n in driven if driven.degree(n) == 1]:
        closed = [n for n in lattice[node] if not driven.has_edge(node, n)]
        if closed and driven.degree(node) == 1 and rng.random() >= dead_ends:
            driven.add_edge(node, closed[rng.integers(len(closed))])
    shift = {n: spacing * (np.array(n) + rng.uniform(-jitter, jitter, 2)) for n in lattice}
    return [LineString([shift[a], shift[b]]).buffer(rng.uniform(*width_m) / 2, quad_segs=4) for a, b in driven.edges]


def _ramp(
    rng: np.random.Generator, size_m: Range, width_m: Range, loops: float, dead_ends: float, spacing_m: float
) -> list[BaseGeometry]:
    """Draw a zigzag ramp with a level at every turn; a drift between two levels makes a loop."""
    long, width = rng.uniform(*size_m), rng.uniform(*width_m)
    turns = max(2, round(rng.uniform(*size_m) / spacing_m))
    path, ends = [], []
    for turn in range(turns):
        y = turn * spacing_m
        x_start, x_end = ((0.0, long), (long, 0.0))[turn % 2]
        path += [(x_start, y), (x_end, y)]
        if turn + 1 < turns:
            side = 1.0 if x_end > 0 else -1.0
            middle = np.array([x_end, y + spacing_m / 2])
            angles = np.linspace(-np.pi / 2, np.pi / 2, 9)[1:-1].tolist()
            path += [tuple(middle + spacing_m / 2 * np.array([side * math.cos(a), math.sin(a)])) for a in angles]
            ends.append((middle + np.array([side * spacing_m / 2, 0.0]), side))
    drifts: list[BaseGeometry] = [LineString(path).buffer(width / 2, quad_segs=4)]
    last: dict[float, np.ndarray] = {}
    for start, side in ends:
        if rng.random() < 1.0 - 0.5 * (1.0 - dead_ends):
            end = start + spacing_m * np.array([side * rng.uniform(0.8, 2.0), rng.uniform(-0.2, 0.2)])
            drifts.append(
                LineString([start - np.array([side, 0.0]), end]).buffer(rng.uniform(*width_m) / 2, quad_segs=4)
            )
            if side in last and rng.random() < loops:
                drifts.append(LineString([last[side], end]).buffer(rng.uniform(*width_m) / 2, quad_segs=4))
            last[side] = end
    return drifts


def _cave(
    rng: np.random.Generator, size_m: Range, width_m: Range, loops: float, dead_ends: float, wander: float
) -> list[BaseGeometry]:
    """Draw winding passages. Each starts on an earlier one; some lead back to another, some have a chamber."""
    long = rng.uniform(*size_m)
    passages = [_wind(rng, np.zeros(2), 0.0, long, wander)]
    for _ in range(max(2, round(long / 25))):
        trunk = passages[rng.integers(len(passages))]
        at = int(rng.integers(1, len(trunk) - 1))
        heading = math.atan2(*(trunk[at] - trunk[at - 1])[::-1]) + rng.choice([-1, 1]) * rng.uniform(0.8, 1.8)
        branch = _wind(rng, trunk[at], heading, rng.uniform(0.2, 0.5) * long, wander)
        if rng.random() >= dead_ends and rng.random() < loops:
            others = np.vstack(passages)
            nearest = others[np.linalg.norm(others - branch[-1], axis=1).argmin()]
            branch = np.vstack([branch, nearest])
        passages.append(branch)
    shapes: list[BaseGeometry] = []
    for passage in passages:
        half = np.interp(np.arange(len(passage)), *_knots(rng, len(passage), width_m)) / 2
        discs = [Point(p).buffer(r, quad_segs=6) for p, r in zip(passage, half, strict=True)]
        shapes += [shapely.union_all([a, b]).convex_hull for a, b in pairwise(discs)]
        if rng.random() < 0.3:
            chamber = Point(passage[rng.integers(len(passage))]).buffer(rng.uniform(1.0, 1.8) * width_m[1], quad_segs=8)
            shapes.append(chamber)
    return shapes


def _wind(rng: np.random.Generator, start: np.ndarray, heading: float, length: float, wander: float) -> np.ndarray:
    """Return the stations (n, 2) m of a passage whose heading varies at random about its initial heading."""
    stations, stray = [start], 0.0
    for _ in range(max(4, round(length / _STEP_M))):
        stray = 0.9 * stray + rng.normal(0.0, 0.35 * wander)
        stations.append(stations[-1] + _STEP_M * np.array([math.cos(heading + stray), math.sin(heading + stray)]))
    return np.array(stations)


def _knots(rng: np.random.Generator, count: int, width_m: Range) -> tuple[np.ndarray, np.ndarray]:
    places = np.arange(0, count + 4, 4)
    return places, rng.uniform(*width_m, size=len(places))
