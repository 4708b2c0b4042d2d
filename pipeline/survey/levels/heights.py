"""Floors of levels and ramps at one height where they meet."""

from __future__ import annotations

from pathlib import Path

import networkx as nx
import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.errors import InputError
from pipeline.guard.reading_process import warn_user
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules
from pipeline.survey.levels.areas import TOUCH_M, Area, places_in
from pipeline.survey.levels.walls import Wall

_ONE_FLOOR_M = 0.05  # floors that differ by less are left as they are
_EASE = 0.1  # slope by which a ramp comes back to its drawn heights
_STEP_M = 1.0  # of the points of a wall that is moved
_LEFT_M = 0.3  # that may remain between ramps so short that both ends move one place


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
