"""Sheets of areas that lie over each other: levels, with ramps and shafts between them."""

from __future__ import annotations

from pathlib import Path

import networkx as nx
import numpy as np
import shapely
import shapely.ops
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.guard.reading_process import warn_user
from pipeline.params.floor_rules import floor_rules
from pipeline.survey.levels.areas import OVERLAP_M2, TOUCH_M, Area, nearest_heights, places_in
from pipeline.survey.levels.joins import area_at, warn_of_near_areas
from pipeline.survey.levels.seams import SeamHeights, join_areas
from pipeline.survey.levels.shafts import LevelSheets, shafts_of
from pipeline.survey.levels.sheet_layout import APART_M, assign_sheets, lay_apart
from pipeline.survey.levels.walls import Wall
from pipeline.survey.passages.pieces import list_others
from pipeline.types import Heights, Place

_EDGE_M = 2.0  # of the points of a wall at which its height is given


def lay_out_levels(
    path: Path, areas: list[Area], axes: list[Wall], snap_m: float, piece: Place | None = None
) -> tuple[MultiPolygon, Heights] | None:
    """Return the areas as sheets side by side, and the heights of their floors.

    None if none lies over another, unless all are joined and a shaft leads from them.

    Areas that meet at one height are joined. The largest piece that is joined is kept, or that at the place `piece`;
    a warning lists the others.

    Parameters
    ----------
    path : Path
    areas : list of Area, m, mine frame
    axes : list of (k, 3) m
        Of shafts, from their upper to their lower end.
    snap_m : float
        Areas no further apart than this meet.
    piece : (float, float, float) or None
        m, mine frame.

    Raises
    ------
    InputError
        If areas lie over each other where they meet, or meet in no straight line, or none is near to `piece`; the
        message names the place.
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
    if not any(over.values()) and not (axes and areas and nx.is_connected(joins)):
        return None
    whole = _chosen(path, areas, joins, piece)
    if len(whole) < len(joins):
        warn_of_near_areas(path, areas, joins)
    number = assign_sheets(whole, {name: name for name in whole}, {name: over[name] & set(whole) for name in whole})
    polygons, of_sheet, seams = join_areas(path, areas, whole, over, number, snap_m)
    offsets = lay_apart(polygons)
    datum = float(np.floor(min(wall[:, 2].min() for found in of_sheet for area in found for wall in area.walls)))
    lines = []
    for k, (polygon, found) in enumerate(zip(polygons, of_sheet, strict=True)):
        own = [(seam, heights) for seam, heights in seams if k in seam.sheets]
        for line in _floor_lines(polygon, found, own):
            moved = line + np.array([*offsets[k], -datum])
            lines.append([(float(x), float(y), float(z)) for x, y, z in moved])
    shafts = shafts_of(path, axes, LevelSheets(polygons, of_sheet, offsets, datum))
    if not shafts and not any(over.values()):
        return None
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
    shapes, step = np.array([area.polygon for area in areas]), floor_rules().flat_step_m
    wide = shapely.buffer(shapes, APART_M / 2)
    found = []
    for a, b in shapely.STRtree(wide).query(wide, predicate="intersects").T.tolist():
        if a >= b:
            continue
        common = wide[a].intersection(wide[b])
        if common.area < OVERLAP_M2:
            continue
        places = places_in(common)
        apart = abs(areas[a].heights_at(places) - areas[b].heights_at(places))
        close = shapely.dwithin(shapes[a], shapely.points(places), APART_M / 2) & shapely.dwithin(
            shapes[b], shapely.points(places), APART_M / 2
        )
        meets = bool((apart[close] <= step).any()) and shapely.dwithin(shapes[a], shapes[b], max(snap_m, TOUCH_M))
        found.append((a, b, bool(meets), bool((apart > step).any())))
    return found


def _chosen(path: Path, areas: list[Area], joins: nx.Graph, piece: Place | None = None) -> nx.Graph:
    """Return the joined areas that are largest together, or those at a place; a warning lists the others."""

    def size(names: set[str]) -> float:
        return float(sum(areas[int(name)].polygon.area for name in names))

    def about(names: set[str]) -> str:
        area = areas[int(min(names, key=int))]
        x, y = area.polygon.representative_point().coords[0]
        return f"{x:.1f},{y:.1f},{float(area.heights_at(np.array([[x, y]]))[0]):.1f}"

    pieces = sorted(nx.connected_components(joins), key=lambda names: (-size(names), min(names)))
    chosen = pieces[0]
    if piece is not None:
        at = str(area_at(path, areas, piece))
        chosen = next(names for names in pieces if at in names)
    others = [names for names in pieces if names is not chosen]
    if others:
        warn_user(
            f"{path.name}: {len(pieces)} pieces of its levels and ramps do not meet; kept is the one of "
            f"{size(chosen):.0f} m2 about {about(chosen)}, left out are {sum(map(size, others)):.0f} m2; "
            "--piece builds another"
        )
        list_others(path, [(f"{size(names):.0f} m2", about(names)) for names in others])
    kept: nx.Graph = nx.Graph()  # in the order of the file; a subgraph has that of a set of texts
    kept.add_nodes_from(name for name in joins if name in chosen)
    kept.add_edges_from((a, b) for a, b in joins.edges if a in chosen)
    return kept


def _floor_lines(polygon: Polygon, areas: list[Area], seams: list[SeamHeights]) -> list[np.ndarray]:
    """Return the walls of a sheet, and its seams, as lines (k, 3) m with the floor's heights."""
    shared = [LineString(seam.ends_m) for seam, _ in seams]
    walls: BaseGeometry = polygon.boundary
    if shared:
        walls = walls.difference(shapely.union_all(shared).buffer(TOUCH_M, cap_style="flat"))
    found = []
    for line in shapely.get_parts(walls):
        places = shapely.get_coordinates(shapely.segmentize(line, _EDGE_M))
        found.append(np.column_stack([places, nearest_heights(areas, places)]))
    for seam, (one, two) in seams:
        ends = np.column_stack([seam.ends_m, (one, two)])
        found.append(np.array([ends[0], ends.mean(axis=0), ends[1]]))
    return found
