"""Which areas of a drawing meet, and their outlines snapped to each other."""

from __future__ import annotations

from pathlib import Path

import networkx as nx
import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.guard.reading_process import warn_user
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules
from pipeline.survey.levels.areas import TOUCH_M, Area, places_in
from pipeline.survey.passages.pieces import require_near
from pipeline.types import Place

_TURNS = 6  # of snapping; two suffice for three areas that meet at one place
_BETWEEN_M = 0.1
_NEAR_M = 3.0  # in plan and in height: warns of two pieces so near


def meetings_of(areas: list[Area], snap_m: float, rules: FloorRules = FLOOR_RULES) -> nx.Graph:
    """Return the areas, by their numbers as texts, and which of them meet at one height, at most `snap_m` apart."""
    graph: nx.Graph = nx.Graph()
    graph.add_nodes_from(str(k) for k in range(len(areas)))
    reach, step = max(snap_m, TOUCH_M), rules.flat_step_m
    shapes = np.array([area.polygon for area in areas])
    for a, b in shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=reach).T.tolist():
        if a < b:
            places = places_in(shapes[a].buffer(reach).intersection(shapes[b].buffer(reach)))
            if (abs(areas[a].heights_at(places) - areas[b].heights_at(places)) <= step).any():
                graph.add_edge(str(a), str(b))
    return graph


def snap_together(
    areas: list[Area], shapes: dict[str, Polygon], joins: nx.Graph, snap_m: float, rules: FloorRules = FLOOR_RULES
) -> None:
    """Let walls that nearly meet at one height meet; change the shapes in place.

    A shape that moves to one neighbour may leave another, if only by rounding. So all are tried again in the other
    direction, until none moves.
    """
    for turn in range(_TURNS):
        before = dict(shapes)
        for a, b in [(b, a) for a, b in joins.edges] if turn % 2 else joins.edges:
            for one, other in ((a, b), (b, a)):
                corners = _corners_near(areas, shapes, other, one, snap_m, rules)
                moved = shapely.snap(shapes[one], corners, snap_m)
                shapes[one] = moved if isinstance(moved, Polygon) and moved.is_valid and moved.area else shapes[one]
        if all(shapely.equals_identical(shape, before[name]) for name, shape in shapes.items()):
            break


def _corners_near(
    areas: list[Area], shapes: dict[str, Polygon], name: str, other: str, snap_m: float, rules: FloorRules
) -> BaseGeometry:
    """Return the corners of a shape that are near another's walls at one height."""
    places = np.unique(shapely.get_coordinates(shapes[name]), axis=0)
    places = places[shapely.dwithin(shapes[other].boundary, shapely.points(places), snap_m)]
    apart = abs(areas[int(name)].heights_at(places) - areas[int(other)].heights_at(places))
    return shapely.multipoints(places[apart <= rules.flat_step_m])


def area_at(path: Path, areas: list[Area], place_m: Place) -> int:
    """Return the number of the area nearest to a place."""
    at, z = np.array([place_m[:2]]), place_m[2]
    aside = shapely.distance([area.polygon for area in areas], shapely.Point(place_m[:2]))
    off = np.hypot(aside, [float(area.heights_at(at)[0]) - z for area in areas])
    require_near(path, place_m, float(off.min()), "the nearest level or ramp")
    return int(off.argmin())


def warn_of_near_areas(path: Path, areas: list[Area], joins: nx.Graph) -> None:
    """Warn of areas of two pieces that nearly meet."""
    piece = {name: k for k, names in enumerate(nx.connected_components(joins)) for name in names}
    shapes = np.array([area.polygon for area in areas])
    near = []
    for a, b in shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=_NEAR_M).T.tolist():
        if a >= b or piece[str(a)] == piece[str(b)]:
            continue
        apart = float(shapely.distance(shapes[a], shapes[b]))
        reach = apart / 2 + _BETWEEN_M
        places = places_in(shapes[a].buffer(reach).intersection(shapes[b].buffer(reach)))
        one, two = (areas[k].heights_at(places) for k in (a, b))
        best = int(abs(one - two).argmin())
        if abs(one[best] - two[best]) <= _NEAR_M:
            near.append((apart, float(one[best]), float(two[best]), *places[best].tolist()))
    if near:
        gap, low, high, x, y = near[0]
        warn_user(
            f"pairs of levels and ramps nearly meet, the first {gap:.2f} m apart in plan at ({x:.1f}, "
            f"{y:.1f}), {low:.1f} and {high:.1f} m high; --snap M says what meets in plan, "
            "survey.flat_step_m in height",
            of=path.name,
            count=len(near),
            option="--snap, survey.flat_step_m",
        )
