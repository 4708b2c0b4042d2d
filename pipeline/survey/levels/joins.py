"""Which areas of a drawing meet, their outlines snapped to each other, and their floors at one height there."""

from __future__ import annotations

from pathlib import Path

import networkx as nx
import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from minesurveys.errors import InputError
from minesurveys.remarks import warn_user
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules
from pipeline.survey.levels.areas import TOUCH_M, Area, places_in
from pipeline.survey.levels.walls import Wall
from pipeline.survey.passages.pieces import require_near
from pipeline.types import Place

_TURNS = 6  # of snapping; two suffice for three areas that meet at one place
_BETWEEN_M = 0.1
_NEAR_M = 3.0  # in plan and in height: warns of two pieces so near
_ONE_FLOOR_M = 0.05  # floors that differ by less are left as they are
_EASE = 0.1  # slope by which a ramp comes back to its drawn heights
_STEP_M = 1.0  # of the points of a wall that is moved
_LEFT_M = 0.3  # that may remain between ramps so short that both ends move one place


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


def even_floors(
    path: Path,
    areas: list[Area],
    shapes: dict[str, Polygon],
    joins: nx.Graph,
    left_m: float = _LEFT_M,
    rules: FloorRules = FLOOR_RULES,
) -> list[Area]:
    """Return areas whose floors have one height where they meet; a warning states the largest change.

    A ramp that is drawn into its level, and leaves it at a small angle, falls from where it is drawn while the level
    does not: their floors differ where they part. Of two areas that meet, the one that slopes more takes the height of
    the other there, and comes back to its own heights at a slope of 10 %.

    Parameters
    ----------
    path : Path
    areas : list of Area
    shapes : dict of str to Polygon
        The areas' outlines by number, snapped to each other.
    joins : nx.Graph
        Which of them meet.
    left_m : float
        That may remain.

    Raises
    ------
    InputError
        If a ramp is so short that its ends cannot both be changed; the message names the place.
    """
    evened, found = list(areas), []
    meetings = {(a, b): where for a, b in joins.edges if (where := _meeting(areas, shapes, a, b, rules)) is not None}
    for (a, b), where in meetings.items():
        most, place = _gap(evened, where, a, b)
        if most <= _ONE_FLOOR_M:
            continue
        found.append((most, place))
        one, two = sorted((int(a), int(b)), key=lambda k: np.ptp(np.concatenate(areas[k].walls)[:, 2]))
        evened[two] = _brought_to(evened[two], evened[one], where, most / _EASE)
    if not found:
        return areas
    for (a, b), where in meetings.items():
        most, (x, y) = _gap(evened, where, a, b)
        if most > left_m:
            raise InputError(
                f"{path}: floors of two areas that meet at ({x:.1f}, {y:.1f}) differ, and the ramp is too short to "
                f"make that even: {most:.2f} m would remain; draw its ends at the levels' heights"
            )
    most, (x, y) = max(found)
    warn_user(
        f"floors of {len(found)} pairs of areas differ where they meet, by up to {most:.2f} m about ({x:.1f}, "
        f"{y:.1f}); there each ramp has the height of its level, and its own from {most / _EASE:.0f} "
        "m on",
        of=path.name,
    )
    return evened


def _meeting(areas: list[Area], shapes: dict[str, Polygon], a: str, b: str, rules: FloorRules) -> BaseGeometry | None:
    """Return where two areas meet at one height; None if nowhere."""
    common = shapes[a].buffer(TOUCH_M).intersection(shapes[b].buffer(TOUCH_M))
    step = rules.flat_step_m
    touching = [part for part in shapely.get_parts(common) if not part.is_empty]  # none if walls only nearly meet
    parts = [part for part in touching if _gap(areas, part, a, b)[0] <= step]
    return shapely.union_all(parts) if parts else None


def _gap(areas: list[Area], where: BaseGeometry, a: str, b: str) -> tuple[float, tuple[float, float]]:
    """Return by how much, m, the floors of two areas differ most in a part of the plan, and where."""
    places = places_in(where)
    apart = abs(areas[int(a)].heights_at(places) - areas[int(b)].heights_at(places))
    x, y = places[apart.argmax()].tolist()
    return float(apart.max()), (x, y)


def _brought_to(area: Area, other: Area, where: BaseGeometry, within_m: float) -> Area:
    """Return an area with the height of another where they meet, and its own from some metres on."""

    def moved(wall: Wall) -> Wall:
        if LineString(wall[:, :2]).distance(where) > within_m:
            return wall
        fine = shapely.get_coordinates(shapely.segmentize(LineString(wall), _STEP_M), include_z=True)
        nearest = shapely.shortest_line(where, shapely.points(fine[:, :2]))
        places = shapely.get_coordinates(nearest)[::2]
        share = np.clip(1.0 - shapely.length(nearest) / within_m, 0.0, 1.0)
        fine[:, 2] += share * (other.heights_at(places) - area.heights_at(places))
        return np.asarray(fine)

    return Area(area.polygon, [moved(wall) for wall in area.walls])
