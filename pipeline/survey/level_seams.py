"""Edges that sheets of levels share: where areas that meet are cut apart."""

from __future__ import annotations

from pathlib import Path

import networkx as nx
import numpy as np
import shapely
import shapely.ops
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.errors import InputError
from pipeline.params.reader_limits import reader_limits
from pipeline.survey.child import tell
from pipeline.survey.level_areas import OVERLAP_M2, TOUCH_M, Area, places_in
from pipeline.survey.sheet_layout import APART_M
from pipeline.types import Seam

_GRID_M = 1e-4  # of the outlines' coordinates
_DIGITS = 4
_NARROWEST_M = 1.0  # of the edge that two sheets share
_STRAIGHT_M = 1e-3
_FURTHER_M = (4.0, 3.0, 2.0, 5.0)  # from where two areas meet to the edge that their sheets share
SeamHeights = tuple[Seam, tuple[float, float]]  # and the heights of its ends, m


def join_areas(
    path: Path, areas: list[Area], joins: nx.Graph, over: dict[str, set[str]], number: dict[str, int], snap_m: float
) -> tuple[list[Polygon], list[list[Area]], list[SeamHeights]]:
    """Return the outline of each sheet, the areas in it, and the edges that two share with their heights."""
    shapes = {name: areas[int(name)].polygon for name in joins}
    for a, b in joins.edges:  # walls that nearly meet meet
        shapes[a] = _valid(shapely.snap(shapes[a], shapes[b], snap_m), shapes[a])
        shapes[b] = _valid(shapely.snap(shapes[b], shapes[a], snap_m), shapes[b])
    of_sheet: list[list[Area]] = [[] for _ in range(max(number.values()) + 1)]
    edges: list[tuple[str, str, str, LineString]] = []
    parts: list[list[Polygon]] = [[] for _ in of_sheet]
    for a, b in joins.edges:
        if number[a] == number[b]:
            continue
        for edge in _cut(path, areas, shapes, a, b):
            for taker, giver in ((a, b), (b, a)):  # a seam is square to the walls of one drift, away from the other
                others = [areas[int(name)] for name in over[giver] if number.get(name) == number[taker]]
                taken = _piece_of(shapes[giver], edge, areas[int(giver)], others)
                if taken is not None:
                    piece, edge = taken
                    shapes[giver] = _largest_part(shapes[giver].difference(piece))
                    parts[number[taker]].append(piece)
                    of_sheet[number[taker]].append(Area(piece, areas[int(giver)].walls))
                    break
            else:
                giver = b
            edges.append((a, b, giver, edge))
    for name, shape in shapes.items():
        parts[number[name]].append(shape)
        of_sheet[number[name]].append(areas[int(name)])
    united = [shapely.set_precision(shapely.union_all(found, grid_size=_GRID_M), 0.0) for found in parts]
    polygons = [_largest_part(shape) for shape in united]
    lost = [part for shape in united for part in _lost(shape)]
    if lost:
        x, y = lost[0].representative_point().coords[0]
        tell(
            f"{path.name}: {len(lost)} areas touch a level, but no way of {_NARROWEST_M:g} m leads into them; they are "
            f"left out, the first, of {lost[0].area:.0f} m2, about ({x:.1f}, {y:.1f})"
        )
    seams = []
    for a, b, giver, edge in edges:
        ends = np.round(shapely.get_coordinates(edge)[[0, -1]], _DIGITS)
        line = LineString(ends)
        if not all(polygons[number[name]].boundary.buffer(TOUCH_M).covers(line) for name in (a, b)):
            x, y = ends.mean(axis=0)
            raise InputError(f"{path}: two levels do not meet from wall to wall at ({x:.1f}, {y:.1f})")
        heights = areas[int(giver)].heights_at(ends)
        places = [(float(x), float(y)) for x, y in ends]
        seams.append((Seam((number[a], number[b]), (places[0], places[1])), (float(heights[0]), float(heights[1]))))
    return polygons, of_sheet, seams


def _piece_of(shape: Polygon, edge: LineString, area: Area, others: list[Area]) -> tuple[Polygon, LineString] | None:
    """Return the piece of a shape between an edge of it and a line some metres further in, and that line.

    None if no such line crosses the shape square to its walls, or the piece lies over other areas.
    """
    (x0, y0), (x1, y1) = edge.coords[0], edge.coords[-1]
    along = np.array([x1 - x0, y1 - y0]) / edge.length
    across = np.array([-along[1], along[0]])
    middle = np.array(edge.centroid.coords[0])
    if not shape.contains(shapely.Point(middle + TOUCH_M * 10 * across)):
        across = -across
    for far in _FURTHER_M:
        at, reach = middle + far * across, edge.length
        found = shape.intersection(LineString([at - reach * along, at + reach * along]))
        line = min(shapely.get_parts(found), key=lambda part: part.distance(shapely.Point(at)), default=None)
        if not isinstance(line, LineString) or not _NARROWEST_M <= line.length < 1.5 * edge.length:
            continue
        pieces = shapely.get_parts(shapely.ops.split(shape, line))
        near = [part for part in pieces if part.dwithin(edge, TOUCH_M)]
        if len(pieces) != 2 or len(near) != 1 or near[0].area > 2 * far * edge.length:
            continue
        if any(_lies_over(near[0], area, other) for other in others):
            continue
        return near[0], line
    return None


def _lies_over(piece: Polygon, area: Area, other: Area) -> bool:
    common = piece.buffer(APART_M).intersection(other.polygon)
    if common.area < OVERLAP_M2:
        return False
    places = places_in(common)
    return bool((abs(area.heights_at(places) - other.heights_at(places)) > reader_limits().flat_step_m).any())


def _largest_part(shape: BaseGeometry) -> Polygon:
    return max(shapely.get_parts(shape), key=lambda part: part.area)


def _lost(shape: BaseGeometry) -> list[Polygon]:
    """Return the parts of a shape that are not its largest one, and wide enough to drive in."""
    parts = sorted(shapely.get_parts(shape), key=lambda part: -part.area)
    return [part for part in parts[1:] if not part.buffer(-_NARROWEST_M / 2).is_empty]


def _valid(shape: BaseGeometry, before: Polygon) -> Polygon:
    return shape if isinstance(shape, Polygon) and shape.is_valid and not shape.is_empty else before


def _cut(path: Path, areas: list[Area], shapes: dict[str, Polygon], a: str, b: str) -> list[LineString]:
    """Cut two areas that meet apart along straight edges, and return these.

    What both cover at one height goes to the larger one, or to the one that would fall apart without it. An edge that
    is not straight is replaced by its chord.
    """
    step = reader_limits().flat_step_m
    if shapes[a].area < shapes[b].area:
        a, b = b, a

    def apart(shape: BaseGeometry) -> np.ndarray:
        places = places_in(shape)
        return abs(areas[int(a)].heights_at(places) - areas[int(b)].heights_at(places))

    for part in shapely.get_parts(shapes[a].intersection(shapes[b])):
        if part.area < OVERLAP_M2 or (difference := apart(part)).min() > step:
            continue
        if difference.max() > step:
            x, y = part.representative_point().coords[0]
            raise InputError(
                f"{path}: two areas meet and lie up to {difference.max():.1f} m over each other at ({x:.1f}, {y:.1f}); "
                "draw the end of the ramp where its floor has the level's height"
            )
        rest = {name: shapes[name].difference(part) for name in (b, a)}
        whole = [name for name in (b, a) if not _lost(rest[name])]
        if not whole:
            x, y = part.representative_point().coords[0]
            raise InputError(
                f"{path}: two areas cross at ({x:.1f}, {y:.1f}); draw one of them in two, on either side of the other"
            )
        shapes[whole[0]] = _largest_part(rest[whole[0]])
    border = shapely.line_merge(shapes[a].boundary.intersection(shapes[b].boundary))
    edges = []
    for line in shapely.get_parts(border):
        if not isinstance(line, LineString) or line.length < _NARROWEST_M or apart(line).min() > step:
            continue
        chord = LineString([line.coords[0], line.coords[-1]])
        between = shapely.polygonize([shapely.union_all([line, chord])])
        for piece in shapely.get_parts(between):
            if piece.area > 0 and shapes[b].buffer(TOUCH_M).covers(piece):
                shapes[a], shapes[b] = shapes[a].union(piece), shapes[b].difference(piece)
            elif piece.area > 0 and shapes[a].buffer(TOUCH_M).covers(piece):
                shapes[a], shapes[b] = shapes[a].difference(piece), shapes[b].union(piece)
            elif piece.area > _STRAIGHT_M * chord.length:
                x, y = chord.centroid.coords[0]
                raise InputError(f"{path}: two areas do not meet in a straight line at ({x:.1f}, {y:.1f})")
        edges.append(chord)
    for name in (a, b):
        shapes[name] = _largest_part(shapes[name])
    return edges
