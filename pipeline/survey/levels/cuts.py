"""Lines across drifts that are square to their walls: where the sheets of levels can be cut apart."""

from __future__ import annotations

import numpy as np
import shapely
import shapely.ops
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.params.floor_rules import floor_rules
from pipeline.survey.levels.areas import OVERLAP_M2, TOUCH_M, Area, places_in
from pipeline.survey.levels.sheet_layout import APART_M

NARROWEST_M = 1.0  # of the edge that two sheets share
_FURTHER_M = (4.0, 3.0, 2.0, 5.0, 3.5, 2.5, 4.5, 1.5)  # from where two areas meet to the edge that their sheets share
_TURNED = np.radians([0, *(side * angle for angle in range(3, 46, 3) for side in (1, -1))])  # of that edge
_ALONG_WALL_M, _WIDEST_M = np.arange(2.0, 21.0), 20.0  # from where they meet, along a wall; of that edge
_SEEN_M, _STEP_M = 0.6, 0.05  # from its ends, where walls may be nearer behind it; the certificate compares so far
_SQUARE_M, _OBLIQUE_M = 0.001, 0.004  # nearer by less: square to its walls; by more: not used


def piece_at(shape: Polygon, edge: LineString, area: Area, others: list[Area]) -> tuple[Polygon, LineString] | None:
    """Return the piece of a shape between an edge of it and a line some metres further in, and that line.

    None if no such line crosses the shape square to its walls, or the piece lies over other areas.
    """
    found = [(line, oblique_m(shape, line)) for line in (*_lines_ahead(shape, edge), *_lines_across(shape, edge))]
    for line, error in sorted(found, key=lambda pair: max(pair[1], _SQUARE_M)):
        if error > _OBLIQUE_M:
            break
        pieces = shapely.get_parts(shapely.ops.split(shape, _longer(line)))
        near = [part for part in pieces if part.dwithin(edge, TOUCH_M)]
        if len(pieces) != 2 or len(near) != 1 or near[0].area > 2 * max(_FURTHER_M) * max(edge.length, line.length):
            continue
        if any(_lies_over(near[0], area, other) for other in others):
            continue
        corners = shapely.get_coordinates(near[0])
        ends = [int(shapely.distance(shapely.points(corners), end).argmin()) for end in line.boundary.geoms]
        return near[0], LineString(corners[ends])
    return None


def _lines_ahead(shape: Polygon, edge: LineString) -> list[LineString]:
    """Return lines across a shape some metres from an edge of it and along it, or turned a little."""
    (x0, y0), (x1, y1) = edge.coords[0], edge.coords[-1]
    along = np.array([x1 - x0, y1 - y0]) / edge.length
    across = np.array([-along[1], along[0]])
    middle = np.array(edge.centroid.coords[0])
    if not shape.contains(shapely.Point(middle + TOUCH_M * 10 * across)):
        across = -across
    reach, found = edge.length, []
    for far in _FURTHER_M:
        at = middle + far * across
        for angle in _TURNED:
            way = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ along
            parts = shapely.get_parts(shape.intersection(LineString([at - reach * way, at + reach * way])))
            line = min(parts, key=lambda part: part.distance(shapely.Point(at)), default=None)
            if isinstance(line, LineString) and NARROWEST_M <= line.length < 1.5 * edge.length:
                found.append(line)
    return found


def _lines_across(shape: Polygon, edge: LineString) -> list[LineString]:
    """Return lines across a shape that begin at its walls some metres from an edge of it, and are square to them."""
    found = []
    walls = shapely.line_merge(shape.boundary.difference(edge.buffer(TOUCH_M)))
    for wall in (part for part in shapely.get_parts(walls) if part.dwithin(edge, 2 * TOUCH_M)):
        for far in _ALONG_WALL_M:
            for place in (far, wall.length - far) if 2 * far < wall.length else ():
                one, two = shapely.get_coordinates(wall.interpolate([place - TOUCH_M, place + TOUCH_M]))
                normal = np.array([one[1] - two[1], two[0] - one[0]]) / np.hypot(*(two - one))
                start = shapely.get_coordinates(wall.interpolate(place))[0]
                if not shape.contains(shapely.Point(start + TOUCH_M * normal)):
                    normal = -normal
                parts = shapely.get_parts(shape.intersection(LineString([start, start + _WIDEST_M * normal])))
                line = min(parts, key=lambda part: part.distance(shapely.Point(start)), default=None)
                if isinstance(line, LineString) and NARROWEST_M <= line.length < _WIDEST_M:
                    found.append(line)
    return found


def oblique_m(shape: BaseGeometry, line: LineString) -> float:
    """Return by how much the walls behind a line may be nearer to a place on it than its own ends, m; 0 if square.

    A sheet ends at its seam: it does not know the walls behind.
    """
    share = np.arange(0.0, min(_SEEN_M, line.length / 2), _STEP_M)
    places = np.concatenate([shapely.line_interpolate_point(line, share), shapely.line_interpolate_point(line, -share)])
    walls = shapely.distance(shapely.intersection(shape.boundary, line.buffer(2 * _SEEN_M)), places)
    return float((np.tile(share, 2) - walls).max())


def _longer(line: LineString) -> LineString:
    """Return a straight line that reaches a little further at both ends: by rounding it may fall short of walls."""
    ends = shapely.get_coordinates(line)[[0, -1]]
    step = TOUCH_M * (ends[1] - ends[0]) / line.length
    return LineString([ends[0] - step, ends[1] + step])


def _lies_over(piece: Polygon, area: Area, other: Area) -> bool:
    common = piece.buffer(APART_M).intersection(other.polygon)
    if common.area < OVERLAP_M2:
        return False
    places = places_in(common)
    return bool((abs(area.heights_at(places) - other.heights_at(places)) > floor_rules().flat_step_m).any())
