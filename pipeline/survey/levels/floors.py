"""Floors of the areas of a drawing, stitched where they meet, and the shafts between them, for one volume."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import networkx as nx
import numpy as np
import shapely
from shapely import LinearRing, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from minesurveys.errors import InputError, first_few
from minesurveys.remarks import warn_user
from pipeline.geometry.floor.stitched import FloorPart, StitchedFloors, stitch
from pipeline.geometry.outline.enclosure import as_polygons
from pipeline.geometry.rock.partition import triangulate
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules
from pipeline.survey.levels.areas import OVERLAP_M2, TOUCH_M, Area, places_in
from pipeline.survey.levels.axes import shaft_legs
from pipeline.survey.levels.joins import area_at, even_floors, meetings_of, snap_together, warn_of_near_areas
from pipeline.survey.levels.walls import Wall
from pipeline.types import DrawnFloors, FloorMesh, Place

_EDGE_M = 2.0  # of the points of a wall at which its height is given
_STITCH_M = 2 * TOUCH_M  # corners of areas that meet are nearer
_GRID_M = 1e-3  # of corners: without a grid rounding leaves spikes of no width where areas are cut
_LEAST_M2 = 0.01  # of a part of an area


@dataclass(frozen=True)
class DrawnLevels:
    """Levels seen from above (m, mine frame), and the floors and shafts of their volume."""

    polygons: MultiPolygon
    shape: DrawnFloors


def floors_of_areas(
    path: Path, areas: list[Area], axes: list[Wall], snap_m: float, piece: Place | None, rules: FloorRules = FLOOR_RULES
) -> DrawnLevels:
    """Return the floors of all areas, those that meet stitched to each other, and the shafts from floor to floor.

    Floors have the heights of their walls, linear between these. What two areas cover at one height is of the larger.

    Parameters
    ----------
    path : Path
    areas : list of Area, m, mine frame
    axes : list of (k, 3) m
        Of shafts, from their upper to their lower end.
    snap_m : float
        Areas no further apart than this meet.
    piece : (float, float, float) or None
        m, mine frame: a place of the areas that are built, with all that they meet; None builds all.

    Raises
    ------
    InputError
        If areas that meet lie over each other there, or none is near to `piece`; the message names the place.
    """
    joins = meetings_of(areas, snap_m, rules)
    if piece is not None:
        chosen = nx.node_connected_component(joins, str(area_at(path, areas, piece)))
        joins = joins.subgraph([name for name in joins if name in chosen]).copy()
    shapes: dict[str, BaseGeometry] = {name: areas[int(name)].polygon for name in joins}
    snap_together(areas, shapes, joins, snap_m, rules)
    shapes = {name: shapely.set_precision(shape, _GRID_M) for name, shape in shapes.items()}
    step = rules.flat_step_m
    evened = even_floors(path, areas, shapes, joins, step, rules)
    for a, b in joins.edges:
        _cut_overlap(path, evened, shapes, a, b, rules)
    names = sorted(joins, key=lambda name: (float(np.ptp(np.concatenate(evened[int(name)].walls)[:, 2])), int(name)))
    every = {name: shapely.get_parts(shapely.set_precision(shapes[name], 0.0)) for name in names}
    outlines = [(name, part) for name, parts in every.items() for part in parts if part.area > _LEAST_M2]
    _share_corners(outlines, joins)
    found = stitch([_part(evened[int(name)], part) for name, part in outlines], _STITCH_M, step)
    joined = _joined(path, evened, shapes, joins, [name for name, _ in outlines], found)
    datum = float(np.floor(found.vertices[:, 2].min()))
    floors = FloorMesh((found.vertices - [0.0, 0.0, datum]).round(6), found.faces.astype(np.int32), datum)
    shafts = shaft_legs(path, axes, floors, rules)
    _warn_of_pieces(path, evened, joined)
    return DrawnLevels(as_polygons(shapely.union_all([part for _, part in outlines])), DrawnFloors(floors, shafts))


def _cut_overlap(
    path: Path, areas: list[Area], shapes: dict[str, BaseGeometry], a: str, b: str, rules: FloorRules
) -> None:
    """Take from the smaller of two areas what both cover at one height; change the shapes in place."""
    step = rules.flat_step_m
    if shapes[a].area < shapes[b].area:
        a, b = b, a
    for part in shapely.get_parts(shapes[a].intersection(shapes[b])):
        if part.is_empty or not isinstance(part, Polygon):
            continue
        places = places_in(part)
        apart = abs(areas[int(a)].heights_at(places) - areas[int(b)].heights_at(places))
        if apart.min() > step:
            continue
        if apart.max() > step and part.area > OVERLAP_M2:
            x, y = part.representative_point().coords[0]
            raise InputError(
                f"{path}: two areas meet and lie up to {apart.max():.1f} m over each other at ({x:.1f}, {y:.1f}); "
                "draw the end of the ramp where its floor has the level's height"
            )
        rest = shapely.difference(shapes[b], part, grid_size=_GRID_M)
        whole = [piece for piece in shapely.get_parts(rest) if isinstance(piece, Polygon)]
        shapes[b] = MultiPolygon(whole)


def _share_corners(outlines: list[tuple[str, Polygon]], joins: nx.Graph) -> None:
    """Give polygons of areas that meet the same corners on their common edges; change the list in place.

    Each edge is then parted alike from either side, so that no point is more than 2 m from the next.
    """
    tree = shapely.STRtree([part for _, part in outlines])
    for _ in range(2):  # corners that one polygon gets from a second are also those of a third
        for k, (name, part) in enumerate(outlines):
            near = [n for n in tree.query(part, "dwithin", _STITCH_M).tolist() if n != k]
            met = [outlines[n][1] for n in near if outlines[n][0] == name or joins.has_edge(name, outlines[n][0])]
            if met:
                outlines[k] = (name, _with_corners(part, shapely.get_coordinates(met)))
    for k, (name, part) in enumerate(outlines):
        outlines[k] = (name, shapely.segmentize(part, _EDGE_M))


def _with_corners(polygon: Polygon, places: np.ndarray) -> Polygon:
    """Return a polygon with further corners at those places (n, 2) m that are on its walls, and have no corner yet."""

    def ring(line: LinearRing) -> np.ndarray:
        points = shapely.points(places)
        own = shapely.get_coordinates(line)[:-1]
        near = shapely.dwithin(line, points, _STITCH_M)
        new = places[near]
        new = new[shapely.distance(shapely.multipoints(own), points[near]) > _STITCH_M]
        every = np.concatenate([own, np.unique(new, axis=0)])
        along = shapely.line_locate_point(line, shapely.points(every))
        along[: len(own)] = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(own, axis=0), axis=1))])
        return np.asarray(every[np.argsort(along, kind="stable")])

    made = Polygon(ring(polygon.exterior), [ring(hole) for hole in polygon.interiors])
    return made if made.is_valid else polygon


def _part(area: Area, outline: Polygon) -> FloorPart:
    points, faces = triangulate(outline)
    return FloorPart(np.column_stack([points, area.heights_at(points)]), faces)


def _joined(
    path: Path,
    areas: list[Area],
    shapes: dict[str, BaseGeometry],
    joins: nx.Graph,
    names: list[str],
    found: StitchedFloors,
) -> nx.Graph:
    """Return which areas share an edge, and warn of those that meet without one: rock stays between them."""
    joined: nx.Graph = nx.Graph()
    joined.add_nodes_from(joins)
    joined.add_edges_from((names[a], names[b]) for a, b in found.joined.tolist())
    apart = [(a, b) for a, b in joins.edges if not nx.has_path(joined, a, b)]
    if apart:
        a, b = apart[0]
        (x, y), other = shapely.shortest_line(shapes[a], shapes[b]).coords
        height = float(areas[int(a)].heights_at(np.array([[x, y]]))[0])
        warn_user(
            f"pairs of areas meet but share no edge, and are not joined, the first at ({x:.1f}, {y:.1f}), "
            f"{height:.1f} m high, {np.hypot(other[0] - x, other[1] - y):.2f} m apart; draw the end of a "
            "ramp along the level's wall, or into the level",
            of=path.name,
            count=len(apart),
        )
    return joined


def _warn_of_pieces(path: Path, areas: list[Area], joins: nx.Graph) -> None:
    """Warn of areas that do not meet the others: all are built."""
    pieces = sorted(nx.connected_components(joins), key=lambda names: -_size_m2(areas, names))
    if len(pieces) < 2:
        return
    sizes = [f"{_size_m2(areas, names):.0f} m2 about {_about(areas, names)}" for names in pieces]
    warn_user(
        "pieces of its levels and ramps do not meet; all are built, and --piece (survey.piece) "
        f"builds one: {first_few(sizes)}",
        of=path.name,
        count=len(pieces),
        option="--piece, survey.piece",
    )
    warn_of_near_areas(path, areas, joins)


def _size_m2(areas: list[Area], names: set[str]) -> float:
    return float(shapely.union_all([areas[int(name)].polygon for name in names]).area)


def _about(areas: list[Area], names: set[str]) -> str:
    area = areas[int(min(names, key=int))]
    x, y = area.polygon.representative_point().coords[0]
    return f"{x:.1f},{y:.1f},{float(area.heights_at(np.array([[x, y]]))[0]):.1f}"
