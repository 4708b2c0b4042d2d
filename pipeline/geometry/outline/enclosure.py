"""Find the workings that walls, drawn as lines, enclose."""

from __future__ import annotations

import networkx as nx
import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from minesurveys.vector.crossings import edges_of
from pipeline.errors import GeometryError

_MOST_SNAP_M = 10.0  # of survey.snap_m: ends farther apart are no gap in a wall
_NEIGHBOURS = 8
_SAME_M = 1e-6  # places nearer than this are one: an arc's end, and a place on a slanted line, are right to 1e-12 only


def enclose_workings(walls: list[LineString], snap_m: float, seeds_m: list[tuple[float, float]]) -> MultiPolygon:
    """Return the workings that walls enclose.

    If all walls are closed, they are nested: the outermost walls enclose workings, the walls within them pillars, and
    so on. Overlapping walls of one level are united. If some walls are open, each open end is joined to the nearest
    wall, and the walls then cut the plane into faces. With seeds, a face is workings if it contains a seed; without,
    if an odd number of walls separates it from the outside.

    Parameters
    ----------
    walls : list of LineString, m
    snap_m : float
        An open end is joined to the nearest wall within this distance.
    seeds_m : list of (x, y)
        Places inside the workings.

    Raises
    ------
    GeometryError
        If the walls enclose nothing, or a seed lies in no face; the message locates a gap.
    """
    closed = [wall for wall in walls if wall.is_closed and len(wall.coords) > 3]
    if len(closed) == len(walls) and not seeds_m:
        return nest_rings(closed)
    linework = shapely.union_all([*walls, *_joints(walls, snap_m)], grid_size=_SAME_M)
    faces = shapely.get_parts(shapely.polygonize([linework]))
    if not len(faces):
        raise GeometryError(f"the walls enclose nothing{_describe_gap(walls, snap_m)}")
    chosen = _faces_of_seeds(faces, seeds_m, walls, snap_m) if seeds_m else _odd_faces(faces)
    return as_polygons(shapely.union_all(chosen))


def nest_rings(rings: list[LineString]) -> MultiPolygon:
    """Return the workings that closed rings enclose: odd levels of nesting are workings, even levels pillars."""
    shapes = (shapely.normalize(shapely.make_valid(Polygon(ring))) for ring in rings)
    distinct = {shape.wkb: shape for shape in shapes if shape.area > 0}  # drawings often hold a line twice
    polygons = np.array(list(distinct.values()), dtype=object)
    if not len(polygons):
        raise GeometryError("the walls enclose nothing")
    inner, outer = shapely.STRtree(polygons).query(polygons, predicate="covered_by")
    depth = np.bincount(inner[inner != outer], minlength=len(polygons))
    result: BaseGeometry = Polygon()
    for level in range(int(depth.max()) + 1):
        here = shapely.union_all(polygons[depth == level])
        result = result.union(here) if level % 2 == 0 else result.difference(here)
    return as_polygons(result)


def as_polygons(geometry: BaseGeometry) -> MultiPolygon:
    """Return the polygons of any geometry, made valid."""
    parts = shapely.get_parts(shapely.make_valid(geometry))
    nested = [shapely.get_parts(part) if hasattr(part, "geoms") else [part] for part in parts]
    return MultiPolygon([p for group in nested for p in group if isinstance(p, Polygon) and p.area > 0])


def _open_ends(walls: list[LineString]) -> np.ndarray:
    """Return the ends (n, 2) m that belong to one wall only."""
    ends = [place for wall in walls if not wall.is_closed for place in (wall.coords[0][:2], wall.coords[-1][:2])]
    if not ends:
        return np.zeros((0, 2))
    places, counts = np.unique(np.round(ends, 6), axis=0, return_counts=True)
    return places[counts == 1]


def _joints(walls: list[LineString], snap_m: float) -> list[LineString]:
    """Return a line from every open end to the nearest wall within `snap_m`."""
    joints, tree, of = [], shapely.STRtree(walls), np.array(walls, dtype=object)
    first, last = shapely.get_point(of, 0), shapely.get_point(of, -1)
    for end in shapely.points(_open_ends(walls)):
        near = tree.query(end.buffer(snap_m))
        begins, stops = (shapely.distance(end, ends[near]) < 1e-5 for ends in (first, last))
        # its own wall: join only to the other end
        targets = np.where(begins, last[near], np.where(stops, first[near], of[near]))
        lengths = shapely.distance(end, targets)
        nearest = int(lengths.argmin()) if len(lengths) else 0
        if len(lengths) and 0 < lengths[nearest] <= snap_m:
            joints.append(shapely.shortest_line(end, targets[nearest]))
    return joints


def _odd_faces(faces: np.ndarray) -> list[Polygon]:
    """Return the faces that an odd number of walls separates from the outside.

    Faces of one linework share whole edges, so faces with an equal edge are neighbours; an edge of one face only is
    outside.
    """
    rings, face = shapely.get_rings(faces, return_index=True)
    edges, ring = edges_of(rings)
    owner = face[ring]
    (x0, y0), (x1, y1) = edges[:, 0].T, edges[:, 1].T
    turned = (x0 > x1) | ((x0 == x1) & (y0 > y1))  # one direction for both faces of an edge
    edges[turned] = edges[turned][:, ::-1]
    _, edge, uses = np.unique(edges.reshape(-1, 4), axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(edge.ravel(), kind="stable")
    first = np.cumsum(uses) - uses
    neighbours: nx.Graph = nx.Graph()
    neighbours.add_nodes_from(range(-1, len(faces)))
    neighbours.add_edges_from((-1, i) for i in owner[order[first[uses == 1]]].tolist())
    pairs = np.stack([owner[order[first[uses == 2]]], owner[order[first[uses == 2] + 1]]], axis=1)
    neighbours.add_edges_from(pairs.tolist())
    depth = nx.single_source_shortest_path_length(neighbours, -1)
    return [faces[i] for i in range(len(faces)) if depth.get(i, 0) % 2 == 1]


def _faces_of_seeds(
    faces: np.ndarray, seeds: list[tuple[float, float]], walls: list[LineString], snap_m: float
) -> list[Polygon]:
    chosen: dict[int, Polygon] = {}
    for x, y in seeds:
        inside = np.flatnonzero(shapely.contains_xy(faces, x, y))
        if not len(inside):
            raise GeometryError(f"the walls round the seed ({x:g}, {y:g}) are open{_describe_gap(walls, snap_m)}")
        chosen[int(inside[0])] = faces[inside[0]]
    return list(chosen.values())


def _describe_gap(walls: list[LineString], snap_m: float) -> str:
    """Return text that locates the nearest pair of open ends farther apart than `snap_m`, or empty text."""
    ends = _open_ends(walls)
    if len(ends) < 2:
        return ""
    distance, _ = cKDTree(ends).query(ends, k=min(_NEIGHBOURS, len(ends)))
    distance[distance <= snap_m] = np.inf
    i, _ = np.unravel_index(int(distance.argmin()), distance.shape)
    gap = float(distance[i].min())
    if not np.isfinite(gap):
        return ""
    place = f"({ends[i][0]:.2f}, {ends[i][1]:.2f})"
    if gap >= _MOST_SNAP_M:
        return f": its open ends are {gap:.2f} m and more apart, at {place}, and at most {_MOST_SNAP_M:g} m are joined"
    return (
        f": the nearest ends left open are {gap:.2f} m apart, at {place}; "
        f"survey.snap_m = {snap_m:g} joins ends nearer than that, --snap M those nearer than M"
    )
