"""Edges that sheets of levels share: where areas that meet are cut apart."""

from __future__ import annotations

from pathlib import Path

import networkx as nx
import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.errors import InputError
from pipeline.guard.reading_process import warn_user
from pipeline.params.floor_rules import floor_rules
from pipeline.survey.levels.areas import OVERLAP_M2, TOUCH_M, Area, places_in
from pipeline.survey.levels.cuts import NARROWEST_M, oblique_m, piece_at
from pipeline.survey.levels.heights import even_floors
from pipeline.survey.levels.joins import snap_together
from pipeline.types import Seam

_GRID_M = 1e-4  # of the outlines' coordinates
_STRAIGHT_M = 1e-3
_WRONG_M = 0.005  # limit of the certificate on clearances
SeamHeights = tuple[Seam, tuple[float, float]]  # and the heights of its ends, m


def join_areas(
    path: Path, areas: list[Area], joins: nx.Graph, over: dict[str, set[str]], number: dict[str, int], snap_m: float
) -> tuple[list[Polygon], list[list[Area]], list[SeamHeights]]:
    """Return the outline of each sheet, the areas in it, and the edges that two share with their heights."""
    shapes = {name: areas[int(name)].polygon for name in joins}
    snap_together(areas, shapes, joins, snap_m)
    areas = even_floors(path, areas, shapes, joins)
    of_sheet: list[list[Area]] = [[] for _ in range(max(number.values()) + 1)]
    edges: list[tuple[str, str, str, LineString]] = []
    parts: list[list[Polygon]] = [[] for _ in of_sheet]
    for a, b in joins.edges:
        if number[a] == number[b]:
            continue
        for edge in _cut(path, areas, shapes, a, b):
            for taker, giver in ((a, b), (b, a)):  # a seam is square to the walls of one drift, away from the other
                others = [areas[int(name)] for name in over[giver] if number.get(name) == number[taker]]
                taken = piece_at(shapes[giver], edge, areas[int(giver)], others)
                if taken is not None:
                    piece, edge = taken
                    shapes[giver] = _largest_part(shapes[giver].difference(piece))
                    parts[number[taker]].append(piece)
                    of_sheet[number[taker]].append(Area(piece, areas[int(giver)].walls))
                    break
            else:
                giver = b
                _require_square(path, shapes[a].union(shapes[b]), edge)
            edges.append((a, b, giver, edge))
    _require_joined(path, areas, shapes, number, joins, edges)
    for name, shape in shapes.items():
        parts[number[name]].append(shape)
        of_sheet[number[name]].append(areas[int(name)])
    united = [_rounded(shapely.union_all(found, grid_size=_GRID_M)) for found in parts]  # one shape is not rounded
    polygons = [_largest_part(shape) for shape in united]
    lost = [part for shape in united for part in _lost(shape)]
    if lost:
        x, y = lost[0].representative_point().coords[0]
        warn_user(
            f"{path.name}: {len(lost)} areas touch a level, but no way of {NARROWEST_M:g} m leads into them; they are "
            f"left out, the first, of {lost[0].area:.0f} m2, about ({x:.1f}, {y:.1f})"
        )
    seams = []
    for a, b, giver, edge in edges:
        line = _rounded(edge)
        ends = shapely.get_coordinates(line)
        if not all(polygons[number[name]].boundary.buffer(TOUCH_M).covers(line) for name in (a, b)):
            x, y = ends.mean(axis=0)
            raise InputError(f"{path}: two levels do not meet from wall to wall at ({x:.1f}, {y:.1f})")
        heights = areas[int(giver)].heights_at(ends)
        places = [(float(x), float(y)) for x, y in ends]
        seams.append((Seam((number[a], number[b]), (places[0], places[1])), (float(heights[0]), float(heights[1]))))
    return polygons, of_sheet, seams


def _require_square(path: Path, shape: BaseGeometry, edge: LineString) -> None:
    """Refuse an edge as a seam to whose walls it is not square: what a robot may reach there would be wrong."""
    if oblique_m(shape, edge) > _WRONG_M:
        x, y = edge.centroid.coords[0]
        raise InputError(
            f"{path}: two areas meet at ({x:.1f}, {y:.1f}), and no line across the drift there is square to its walls; "
            "draw both walls straight and parallel for 2 m"
        )


def _require_joined(
    path: Path,
    areas: list[Area],
    shapes: dict[str, Polygon],
    number: dict[str, int],
    joins: nx.Graph,
    edges: list[tuple[str, str, str, LineString]],
) -> None:
    """Refuse areas that meet if no edge joins their sheets."""
    sheets: nx.Graph = nx.Graph()
    sheets.add_nodes_from(number.values())
    sheets.add_edges_from((number[a], number[b]) for a, b, _, _ in edges)
    for a, b in joins.edges:
        if nx.has_path(sheets, number[a], number[b]):
            continue
        common = shapes[a].buffer(TOUCH_M).intersection(shapes[b].buffer(TOUCH_M))
        if common.is_empty:
            (x, y), _ = shapely.shortest_line(shapes[a], shapes[b]).coords
            raise InputError(
                f"{path}: two areas nearly meet at ({x:.1f}, {y:.1f}), {shapes[a].distance(shapes[b]):.2f} m apart, "
                "and their corners do not snap to one line; draw a common edge, or state --snap 0 to keep them apart"
            )
        places = places_in(common)
        apart = abs(areas[int(a)].heights_at(places) - areas[int(b)].heights_at(places))
        x, y = places[apart.argmin()]
        raise InputError(
            f"{path}: two areas meet at ({x:.1f}, {y:.1f}), but share no straight edge of {NARROWEST_M:g} m there; "
            "draw the end of the ramp along the level's wall, or into the level"
        )


def _rounded(shape: BaseGeometry) -> BaseGeometry:
    """Return a shape with its coordinates on the grid of the outlines."""
    return shapely.set_precision(shapely.set_precision(shape, _GRID_M), 0.0)


def _largest_part(shape: BaseGeometry) -> Polygon:
    return max(shapely.get_parts(shape), key=lambda part: part.area)


def _lost(shape: BaseGeometry) -> list[Polygon]:
    """Return the parts of a shape that are not its largest one, and wide enough to drive in."""
    parts = sorted(shapely.get_parts(shape), key=lambda part: -part.area)
    return [part for part in parts[1:] if not part.buffer(-NARROWEST_M / 2).is_empty]


def _cut(path: Path, areas: list[Area], shapes: dict[str, Polygon], a: str, b: str) -> list[LineString]:
    """Cut two areas that meet apart along straight edges, and return these.

    What both cover at one height goes to the larger one, or to the one that would fall apart without it. An edge that
    is not straight is replaced by its chord.
    """
    step = floor_rules().flat_step_m
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
        if not isinstance(line, LineString) or line.length < NARROWEST_M or apart(line).min() > step:
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
