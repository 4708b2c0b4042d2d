"""Sheets of areas that lie over each other: levels, with ramps and shafts between them."""

from __future__ import annotations

from pathlib import Path

import networkx as nx
import numpy as np
import shapely
import shapely.ops
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.errors import InputError
from pipeline.params.reader_limits import FILE, reader_limits
from pipeline.survey.child import tell
from pipeline.survey.level_areas import Area, Wall, nearest_heights
from pipeline.survey.level_shafts import shafts_of
from pipeline.survey.sheet_layout import APART_M, assign_sheets, lay_apart
from pipeline.types import Heights, Seam

_GRID_M = 1e-4  # of the outlines' coordinates
_DIGITS = 4
_EDGE_M = 2.0  # of the points of a wall at which its height is given
_NARROWEST_M = 1.0  # of the edge that two sheets share
_TOUCH_M = 1e-3
_STRAIGHT_M = 1e-3
_OVERLAP_M2 = 0.01
_FURTHER_M = (4.0, 3.0, 2.0, 5.0)  # from where two areas meet to the edge that their sheets share
_BETWEEN_M = 0.1
_NEAR_M = 3.0  # in plan and in height: two pieces so near are told
_SAMPLE_M = 1.0  # of the places where two areas are compared

SeamHeights = tuple[Seam, tuple[float, float]]  # and the heights of its ends, m


def draw_levels(path: Path, areas: list[Area], plumb: list[Wall], snap_m: float) -> tuple[MultiPolygon, Heights] | None:
    """Return the areas as sheets side by side, and the heights of their floors; None if none lies over another.

    Areas that meet at one height are joined. The largest piece that is joined is kept, the others are said.

    Parameters
    ----------
    path : Path
    areas : list of Area, m, mine frame
    plumb : list of (2, 3) m
        Shafts, from their upper to their lower end.
    snap_m : float
        Areas no further apart than this meet.

    Raises
    ------
    InputError
        If areas lie over each other where they meet, or meet in no straight line; the message names the place.
    """
    names = [str(k) for k in range(len(areas))]
    joins: nx.Graph = nx.Graph()
    joins.add_nodes_from(names)
    over: dict[str, set[str]] = {name: set() for name in names}
    for a, b, meets, lies_over in _pairs(areas, snap_m):
        if meets:
            joins.add_edge(names[a], names[b])
        if lies_over:
            over[names[a]].add(names[b])
            over[names[b]].add(names[a])
    if not any(over.values()):
        return None
    whole = _largest(path, areas, joins)
    if len(whole) < len(joins):
        _tell_near(path, areas, joins)
    number = assign_sheets(whole, {name: name for name in whole}, {name: over[name] & set(whole) for name in whole})
    polygons, of_sheet, seams = _join(path, areas, whole, over, number, snap_m)
    offsets = lay_apart(polygons)
    datum = float(np.floor(min(wall[:, 2].min() for found in of_sheet for area in found for wall in area.walls)))
    lines = []
    for k, (polygon, found) in enumerate(zip(polygons, of_sheet, strict=True)):
        own = [(seam, heights) for seam, heights in seams if k in seam.sheets]
        for line in _floor_lines(polygon, found, own):
            moved = line + np.array([*offsets[k], -datum])
            lines.append([(float(x), float(y), float(z)) for x, y, z in moved])
    shafts = shafts_of(path, plumb, polygons, of_sheet, offsets, datum)
    heights = Heights(
        lines=lines,
        datum_m=datum,
        offset_m=[(float(x), float(y)) for x, y in offsets],
        seams=[seam for seam, _ in seams],
        shafts=shafts,
    )
    moved_polygons = [shapely.transform(p, lambda xy, d=offsets[k]: xy + d) for k, p in enumerate(polygons)]
    return MultiPolygon(moved_polygons), heights


def _pairs(areas: list[Area], snap_m: float) -> list[tuple[int, int, bool, bool]]:
    """Return the pairs of areas that meet at one height, or lie over each other at different heights."""
    shapes, step = np.array([area.polygon for area in areas]), reader_limits().flat_step_m
    wide = shapely.buffer(shapes, APART_M / 2)
    found = []
    for a, b in shapely.STRtree(wide).query(wide, predicate="intersects").T.tolist():
        if a >= b:
            continue
        common = wide[a].intersection(wide[b])
        if common.area < _OVERLAP_M2:
            continue
        places = _places_in(common)
        apart = abs(areas[a].heights_at(places) - areas[b].heights_at(places))
        close = shapely.dwithin(shapes[a], shapely.points(places), APART_M / 2) & shapely.dwithin(
            shapes[b], shapely.points(places), APART_M / 2
        )
        meets = bool((apart[close] <= step).any()) and shapely.dwithin(shapes[a], shapes[b], max(snap_m, _TOUCH_M))
        found.append((a, b, bool(meets), bool((apart > step).any())))
    return found


def _places_in(shape: BaseGeometry) -> np.ndarray:
    """Return places (n, 2) m all over a shape: about its boundary, and one inside each part."""
    inner = [part.representative_point() for part in shapely.get_parts(shape)]
    return shapely.get_coordinates([shapely.segmentize(shape, _SAMPLE_M), *inner])


def _largest(path: Path, areas: list[Area], joins: nx.Graph) -> nx.Graph:
    """Return the joined areas that are largest together, and say what is left out."""

    def size(names: set[str]) -> float:
        return float(sum(areas[int(name)].polygon.area for name in names))

    pieces = sorted(nx.connected_components(joins), key=lambda names: (-size(names), min(names)))
    if len(pieces) > 1:
        left = [areas[int(name)] for names in pieces[1:] for name in sorted(names)]
        x, y = left[0].polygon.representative_point().coords[0]
        z = float(left[0].heights_at(np.array([[x, y]]))[0])
        tell(
            f"{path.name}: {len(pieces)} pieces of its levels and ramps do not meet; kept is the one of "
            f"{size(pieces[0]):.0f} m2, left out are {sum(map(size, pieces[1:])):.0f} m2, the first about "
            f"({x:.1f}, {y:.1f}), {z:.1f} m high"
        )
    kept: nx.Graph = nx.Graph()  # in the order of the file; a subgraph has that of a set of texts
    kept.add_nodes_from(name for name in joins if name in pieces[0])
    kept.add_edges_from((a, b) for a, b in joins.edges if a in pieces[0])
    return kept


def _tell_near(path: Path, areas: list[Area], joins: nx.Graph) -> None:
    """Say where areas of two pieces nearly meet."""
    piece = {name: k for k, names in enumerate(nx.connected_components(joins)) for name in names}
    shapes = np.array([area.polygon for area in areas])
    near = []
    for a, b in shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=_NEAR_M).T.tolist():
        if a >= b or piece[str(a)] == piece[str(b)]:
            continue
        apart = float(shapely.distance(shapes[a], shapes[b]))
        reach = apart / 2 + _BETWEEN_M
        places = _places_in(shapes[a].buffer(reach).intersection(shapes[b].buffer(reach)))
        one, two = (areas[k].heights_at(places) for k in (a, b))
        best = int(abs(one - two).argmin())
        if abs(one[best] - two[best]) <= _NEAR_M:
            near.append((apart, float(one[best]), float(two[best]), *places[best].tolist()))
    if near:
        gap, low, high, x, y = near[0]
        tell(
            f"{path.name}: {len(near)} pairs of levels and ramps nearly meet, the first {gap:.2f} m apart in plan at "
            f"({x:.1f}, {y:.1f}), {low:.1f} and {high:.1f} m high; survey.snap_m says what meets in plan, "
            f"flat_step_m in {FILE} in height"
        )


def _join(
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
        if not all(polygons[number[name]].boundary.buffer(_TOUCH_M).covers(line) for name in (a, b)):
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
    if not shape.contains(shapely.Point(middle + _TOUCH_M * 10 * across)):
        across = -across
    for far in _FURTHER_M:
        at, reach = middle + far * across, edge.length
        found = shape.intersection(LineString([at - reach * along, at + reach * along]))
        line = min(shapely.get_parts(found), key=lambda part: part.distance(shapely.Point(at)), default=None)
        if not isinstance(line, LineString) or not _NARROWEST_M <= line.length < 1.5 * edge.length:
            continue
        pieces = shapely.get_parts(shapely.ops.split(shape, line))
        near = [part for part in pieces if part.dwithin(edge, _TOUCH_M)]
        if len(pieces) != 2 or len(near) != 1 or near[0].area > 2 * far * edge.length:
            continue
        if any(_lies_over(near[0], area, other) for other in others):
            continue
        return near[0], line
    return None


def _lies_over(piece: Polygon, area: Area, other: Area) -> bool:
    common = piece.buffer(APART_M).intersection(other.polygon)
    if common.area < _OVERLAP_M2:
        return False
    places = _places_in(common)
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
        places = _places_in(shape)
        return abs(areas[int(a)].heights_at(places) - areas[int(b)].heights_at(places))

    for part in shapely.get_parts(shapes[a].intersection(shapes[b])):
        if part.area < _OVERLAP_M2 or (difference := apart(part)).min() > step:
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
            if piece.area > 0 and shapes[b].buffer(_TOUCH_M).covers(piece):
                shapes[a], shapes[b] = shapes[a].union(piece), shapes[b].difference(piece)
            elif piece.area > 0 and shapes[a].buffer(_TOUCH_M).covers(piece):
                shapes[a], shapes[b] = shapes[a].difference(piece), shapes[b].union(piece)
            elif piece.area > _STRAIGHT_M * chord.length:
                x, y = chord.centroid.coords[0]
                raise InputError(f"{path}: two areas do not meet in a straight line at ({x:.1f}, {y:.1f})")
        edges.append(chord)
    for name in (a, b):
        shapes[name] = _largest_part(shapes[name])
    return edges


def _floor_lines(polygon: Polygon, areas: list[Area], seams: list[SeamHeights]) -> list[np.ndarray]:
    """Return the walls of a sheet, and its seams, as lines (k, 3) m with the floor's heights."""
    shared = [LineString(seam.ends_m) for seam, _ in seams]
    walls: BaseGeometry = polygon.boundary
    if shared:
        walls = walls.difference(shapely.union_all(shared).buffer(_TOUCH_M, cap_style="flat"))
    found = []
    for line in shapely.get_parts(walls):
        places = shapely.get_coordinates(shapely.segmentize(line, _EDGE_M))
        found.append(np.column_stack([places, nearest_heights(areas, places)]))
    for seam, (one, two) in seams:
        ends = np.column_stack([seam.ends_m, (one, two)])
        found.append(np.array([ends[0], ends.mean(axis=0), ends[1]]))
    return found
