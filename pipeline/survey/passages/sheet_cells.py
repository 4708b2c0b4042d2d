"""Stations of a survey in three dimensions with the halves of their legs: outline in plan, and lines of the floor."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import networkx as nx
import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minexplore.floors.stretch import LEAST_ROOF_M, MOST_ROOF_M
from pipeline.geometry.polyline import arc_length
from pipeline.survey.passages.hairpins import level_hairpins
from pipeline.survey.passages.legs import SurveyLeg
from pipeline.survey.passages.relief import floor_of

# Node or "" between two; place (3,) m, with the roof over it as metres and a share of the drifts' height (2,); left and
# right (2,) m.
Way = list[tuple[str, np.ndarray, np.ndarray, np.ndarray]]
UNIT_M = 8.0  # a cell of the plan reaches half of this from its station along each leg
_NARROWEST_M = 0.05
_SAME_WALL_M = 0.2  # ends of the walls of two legs at a station that are so near are one
_ONWARDS = 0.5  # cosine of the angle by which two legs may turn at a station and still share a wall


@dataclass
class Cell:
    """A station with its halves of the legs that meet there: outline, and the lines (k, 2, 5) of its floor and roof."""

    name: str
    shapes: list[BaseGeometry] = field(default_factory=list)
    lines: list[np.ndarray] = field(default_factory=list)

    @property
    def span_m(self) -> tuple[float, float]:
        """Return the lowest and the highest place of the cell's floor, m; 0 without a line, as `height_at`."""
        heights = np.array(self.lines)[:, :, 2] if self.lines else np.zeros(1)
        return float(heights.min()), float(heights.max())

    def height_at(self, x: float, y: float) -> float:
        """Return the floor's height on the nearest line of the cell."""
        best, height = np.inf, 0.0
        for a, b in self.lines:
            step = b[:2] - a[:2]
            share = float(np.clip(np.dot((x, y) - a[:2], step) / max(float(np.dot(step, step)), 1e-12), 0.0, 1.0))
            far = float(np.hypot(*(a[:2] + share * step - (x, y))))
            if far < best:
                best, height = far, float(a[2] + share * (b[2] - a[2]))
        return height


def roof_of(leg: SurveyLeg) -> np.ndarray:
    """Return the roof over the floor at the stations of a leg (n, 2): metres, and a share of the drifts' height.

    The share is 1 at a station without a distance up, else 0. A roof beyond the limits counts as the limit.
    """
    assert leg.heights_m is not None
    over = leg.heights_m[:, 0] + leg.heights_m[:, 1] - floor_of(leg)
    known = np.isfinite(over)
    return np.column_stack([np.where(known, np.clip(over, LEAST_ROOF_M, MOST_ROOF_M), 0.0), ~known])


def survey_cells(legs: list[SurveyLeg]) -> tuple[dict[str, Cell], nx.Graph, list[Way]]:
    """Return the cells by station, the graph of their neighbours with distances, and each leg's points."""
    cells: dict[str, Cell] = {}
    graph: nx.Graph = nx.Graph()
    ways = [_way(number, leg) for number, leg in enumerate(legs)]
    level_hairpins(ways, [set(leg.stations) for leg in legs])
    _join_walls(ways, cells)
    for way, leg in zip(ways, legs, strict=True):
        names = set(leg.stations)
        for i, (node, place, left, right) in enumerate(way):
            if not node:
                cut = np.array([[*left, place[2]], [*right, place[2]]])
                length = float(np.hypot(*(way[i + 1][1] - way[i - 1][1])[:2]))
                graph.add_edge(way[i - 1][0], way[i + 1][0], length=length, cut=cut)
                continue
            cell = cells.setdefault(node, Cell(node))
            half = np.linalg.norm(np.array([left, right]) - place[:2], axis=1)
            graph.add_node(node)
            beside = [way[j][1] for j in (i - 1, i + 1) if 0 <= j < len(way)]
            cuts_m = min(float(np.hypot(*(cut - place)[:2])) for cut in beside)
            if node in names and (len(beside) == 1 or half.min() < cuts_m):  # within a leg the quadrilaterals suffice
                cell.shapes.append(shapely.Point(place[:2]).buffer(half.min(), quad_segs=4))
            for j in (i - 1, i + 1):
                if 0 <= j < len(way):
                    _, other, *walls = way[j]
                    cell.shapes.append(shapely.convex_hull(shapely.multipoints([left, *walls, right])))
                    cell.lines.append(np.array([place, other]))
    return cells, graph, ways


def shot_numbers(way: Way, leg: SurveyLeg) -> list[int]:
    """Return for each point of a leg but the last the number of the shot that begins at it or goes on there."""
    names = set(leg.stations)
    return (np.cumsum([node in names for node, *_ in way[:-1]]) - 1).tolist()


def _way(number: int, leg: SurveyLeg) -> Way:
    """Return the points of a leg: its stations, places between them if they are far apart, and the cuts half-way."""
    places, names = np.column_stack([leg.positions_m, floor_of(leg), roof_of(leg)]), list(leg.stations)
    walls = np.maximum(leg.walls_m, _NARROWEST_M)
    along = arc_length(places[:, :2])
    at, nodes = [along[0]], [names[0]]
    for k, (a, b) in enumerate(pairwise(along)):
        count = max(1, round((b - a) / UNIT_M))
        at += np.linspace(a, b, 2 * count + 1)[1:].tolist()
        nodes += [name for j in range(1, count) for name in ("", f"{number}:{k}:{j}")] + ["", names[k + 1]]
    points = np.column_stack([np.interp(at, along, places[:, k]) for k in range(5)])
    sides = np.column_stack([np.interp(at, along, walls[:, k]) for k in range(2)])
    heading = np.gradient(points[:, :2], axis=0)
    heading /= np.maximum(np.linalg.norm(heading, axis=1, keepdims=True), 1e-12)
    to_left = np.column_stack([-heading[:, 1], heading[:, 0]])
    left, right = points[:, :2] + to_left * sides[:, :1], points[:, :2] - to_left * sides[:, 1:]
    return list(zip(nodes, points, left, right, strict=True))


def _join_walls(ways: list[Way], cells: dict[str, Cell]) -> None:
    """Join the walls of legs that meet at a station and go on in about one direction: else a slit would part them."""
    ends: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for way in ways:
        for node, place, left, right in (way[0], way[-1]):
            ends.setdefault(node, []).extend([(place[:2], left), (place[:2], right)])
    for node, walls in ends.items():
        for k, (place, one) in enumerate(walls):
            for _, other in walls[k + 1 :]:
                if (one == other).all():
                    continue
                if np.hypot(*(one - other)) < _SAME_WALL_M:
                    one[:] = other[:] = (one + other) / 2
                else:
                    arms = np.array([one, other]) - place
                    lengths = np.linalg.norm(arms, axis=1)
                    if arms[0] @ arms[1] > _ONWARDS * lengths.prod():
                        corners = shapely.multipoints([place, one, other])
                        cells.setdefault(node, Cell(node)).shapes.append(shapely.convex_hull(corners))
