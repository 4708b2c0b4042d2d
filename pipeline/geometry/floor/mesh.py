"""The floor's mesh: the workings triangulated about lines of known height, with harmonic heights between the lines."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.spatial import cKDTree
from shapely.geometry.base import BaseGeometry

from minexplore.floors.floor import Floor
from minexplore.floors.stretch import KNEE_M, LEAST_ROOF_M, LEAST_STRETCH, MOST_ROOF_M, least_roof_m, stretch_of
from pipeline.errors import GeometryError
from pipeline.geometry.floor.solved_heights import solve_heights
from pipeline.geometry.polyline import arc_length
from pipeline.geometry.rock.delaunay import Triangulation
from pipeline.types import Seam

SPACING_M = 3.0  # of the points of a line; a drift is 3 to 6 m wide
_ON_LINE_M, _ON_WALL_M = 0.02, 0.3  # corners nearer than this to a new point take its place
_SQUARE = 1.05  # a line across a drift that is so much longer than the shortest is not square to the walls
_HAIRPIN = 0.0  # cosine of the turn beyond which the drift beside a bend is not level across
_SAME_ROOF_M = 1e-6
_TWIN_M = 1e-6  # between the corners of two sheets on their seam
_WIDEST_M = 20.0  # beyond this from a line, a wall gets no corner for its points


def build_floor(
    workings: BaseGeometry,
    lines: list[np.ndarray],
    steepest_deg: float,
    offset_m: list[tuple[float, float]] | None = None,
    seams: list[Seam] | None = None,
    height_m: float = 0.0,
) -> Floor:
    """Triangulate workings about lines of known floor height and find the heights between.

    The heights are harmonic: the lines' heights are kept, and there is no slope across the walls. Along a straight
    drift the floor is then linear between the points of its line and level across.

    Parameters
    ----------
    workings : shapely Polygon, m, plan
    lines : list of (k, 3) or (k, 4) float64, m
        Where the floor is known, and how high the roof is over it; points outside the workings count for the nearest
        wall, where no nearer one does.
    steepest_deg : float
        The steepest floor that is built.
    offset_m, seams : list
        How far each sheet is moved aside, and the edges that sheets share; the workings then have one part a sheet.
    height_m : float
        Of the roof over the floor in the plan; needed if the lines have roofs.

    Raises
    ------
    GeometryError
        If a piece of the workings has no height, the floor is steeper, or a roof too low; the message names the place.
    """
    workings = shapely.set_precision(workings, 0.0)  # else results are rounded to the grid that it carries
    parts = shapely.get_parts(workings)
    offsets = np.array(offset_m or [(0.0, 0.0)])
    mesh = Triangulation(workings)
    known: dict[int, list[list[float]]] = defaultdict(list)
    fine = [_fill(line) for line in lines]
    for line in fine:
        for x, y, *values in line.tolist():
            number = mesh.insert((x, y), _ON_LINE_M)
            known[number].append([float(np.hypot(*np.subtract(mesh.xy[number], (x, y)))), *values])
    known = defaultdict(list, {number: _nearest(rows) for number, rows in known.items()})
    closed = shapely.union_all([_seam_line(seam, k, offsets) for seam in seams or [] for k in seam.sheets])
    for foot, values in _feet(workings, fine):
        if seams and closed.dwithin(shapely.Point(foot), _ON_WALL_M):
            continue  # both sheets must have the same corners on their seam: its ends and its middle
        number = mesh.insert(foot, _ON_WALL_M)
        if values is not None and np.hypot(*np.subtract(mesh.xy[number], foot)) < _ON_LINE_M:
            known[number].append(values)
    points, faces = mesh.arrays()
    sheet = np.zeros(len(faces), np.int32)
    if len(parts) > 1:
        sheet = shapely.STRtree(parts).nearest(shapely.points(points[faces].mean(axis=1))).astype(np.int32)
    twin = _twins(points, faces, sheet, offsets, seams or [])
    columns = [
        _harmonic(
            points, faces, twin, {number: float(np.mean([row[k] for row in rows])) for number, rows in known.items()}
        )
        for k in range(lines[0].shape[1] - 2)
    ]
    floor = Floor(np.column_stack([points, columns[0]]), faces, sheet, offsets)
    if len(columns) > 1:
        floor = replace(floor, stretch=_stretch(columns[1], np.concatenate(lines), height_m))
    require_gentle(floor, steepest_deg)
    return floor


def _nearest(rows: list[list[float]]) -> list[list[float]]:
    """Return the values of the points that count at a corner, each given with its distance: the nearest ones."""
    least = min(row[0] for row in rows)
    return [values for apart, *values in rows if apart <= least + _ON_LINE_M]


def _stretch(roof_m: np.ndarray, known: np.ndarray, height_m: float) -> np.ndarray:
    """Return how much (n,) the plan is stretched so that its roof is as surveyed; none if all roofs are the plan's.

    Parameters
    ----------
    roof_m : (n,) m
        Over the floor at the vertices.
    known : (k, 4) m
        Where the survey knows floor and roof.
    height_m : float
        Of the roof in the plan.
    """
    least, (x, y, _, lowest) = least_roof_m(height_m), known[known[:, 3].argmin()]
    if np.abs(known[:, 3] - height_m).max() < _SAME_ROOF_M:
        return np.zeros(0)
    if height_m < LEAST_ROOF_M or lowest < least - _SAME_ROOF_M:
        most = KNEE_M + (lowest - KNEE_M) / LEAST_STRETCH
        raise GeometryError(
            f"roof: {lowest:.2f} m over the floor at ({x:.1f}, {y:.1f}), the lowest of the survey; with it "
            f"compile3d.height_m = {height_m:g} must be {LEAST_ROOF_M:g} to {max(most, LEAST_ROOF_M):.2f} m"
        )
    return stretch_of(np.clip(roof_m, least, MOST_ROOF_M), height_m)


def _seam_line(seam: Seam, sheet: int, offsets: np.ndarray) -> BaseGeometry:
    return shapely.LineString(np.array(seam.ends_m) + offsets[sheet])


def _twins(
    points: np.ndarray, faces: np.ndarray, sheet: np.ndarray, offsets: np.ndarray, seams: list[Seam]
) -> np.ndarray:
    """Return for each point its own number, or of two points at one place of a seam the lower number."""
    twin = np.arange(len(points))
    for seam in seams:
        rows = []
        for k in seam.sheets:
            own = np.unique(faces[sheet == k])
            near = shapely.dwithin(_seam_line(seam, k, offsets), shapely.points(points[own]), _TWIN_M)
            rows.append(own[near])
        places = [points[own] - offsets[k] for own, k in zip(rows, seam.sheets, strict=True)]
        apart, match = cKDTree(places[1]).query(places[0])
        if len(rows[0]) != len(rows[1]) or apart.max() > _TWIN_M:
            x, y = np.mean(seam.ends_m, axis=0)
            raise GeometryError(f"floor: the sheets {seam.sheets} do not fit together at ({x:.1f}, {y:.1f})")
        points[rows[1][match]] = places[0] + offsets[seam.sheets[1]]
        low = np.minimum(twin[rows[0]], twin[rows[1][match]])
        twin[rows[0]] = twin[rows[1][match]] = low
    return twin


def require_gentle(floor: Floor, steepest_deg: float) -> None:
    """Refuse a floor with a face steeper than a limit."""
    corners = floor.vertices[floor.faces]
    rise, steep = np.ptp(corners[:, :, 2], axis=1), floor.steepness_deg()
    worst = int(steep.argmax())
    if steep[worst] > steepest_deg:
        x, y, z = corners[worst].mean(axis=0)
        raise GeometryError(
            f"floor: {steep[worst]:.1f} deg steep at ({x:.1f}, {y:.1f}), {z:.1f} m high, over {rise[worst]:.2f} m; the "
            f"limit is compile3d.steepest_deg = {steepest_deg:g}; do two drifts of different heights touch in plan?"
        )


def _fill(line: np.ndarray) -> np.ndarray:
    """Return a line with further points, no more than the spacing apart."""
    along = arc_length(line[:, :2])
    pieces = [np.linspace(a, b, max(2, int(np.ceil((b - a) / SPACING_M)) + 1))[:-1] for a, b in pairwise(along)]
    at = np.concatenate([*pieces, along[-1:]])
    return np.column_stack([np.interp(at, along, line[:, k]) for k in range(line.shape[1])])


def _feet(workings: BaseGeometry, lines: list[np.ndarray]) -> list[tuple[tuple[float, float], list[float] | None]]:
    """Return where level lines across the drift meet the walls, each with its line's values of floor and roof.

    None stands for the values near junctions and bends.
    """
    starts, ends, of, along = [], [], [], []
    for number, line in enumerate(lines):
        heading = np.gradient(line[:, :2], axis=0) if len(line) > 1 else np.zeros((1, 2))
        heading /= np.maximum(np.linalg.norm(heading, axis=1, keepdims=True), 1e-9)
        left = np.column_stack([-heading[:, 1], heading[:, 0]])
        for side in (left, -left):
            starts.append(line)
            ends.append(line[:, :2] + _WIDEST_M * side)
            of += [number] * len(line)
            along.append(heading)
    start, end, line_of, ahead = np.concatenate(starts), np.concatenate(ends), np.array(of), np.concatenate(along)
    shapely.prepare(workings)
    inside = shapely.contains_xy(workings, start[:, 0], start[:, 1])
    start, end, line_of, ahead = start[inside], end[inside], line_of[inside], ahead[inside]
    wall, every = workings.boundary, cKDTree(start[:, :2])
    hits = shapely.intersection(shapely.linestrings(np.stack([start[:, :2], end], axis=1)), wall)
    clearance = shapely.distance(wall, shapely.points(start[:, :2]))
    feet: list[tuple[tuple[float, float], list[float] | None]] = []
    for k, ((x0, y0, *values), near_m, hit) in enumerate(zip(start.tolist(), clearance.tolist(), hits, strict=True)):
        places = shapely.get_coordinates(hit)
        if len(places):
            apart = np.hypot(places[:, 0] - x0, places[:, 1] - y0)
            x, y = places[apart.argmin()].tolist()
            own = float(apart.min())
            is_square = own <= _SQUARE * near_m and every.query((x, y))[0] > own / _SQUARE
            is_level = is_square and (line_of[every.query_ball_point((x0, y0), 2 * own)] == line_of[k]).all()
            bend = every.query_ball_point((x0, y0), own + SPACING_M)  # inside a hairpin, walls of both arms meet
            is_level = is_level and (ahead[bend] @ ahead[k] > _HAIRPIN).all()
            feet.append(((x, y), values if is_level else None))
    return feet


def _harmonic(points: np.ndarray, faces: np.ndarray, twin: np.ndarray, known: dict[int, float]) -> np.ndarray:
    """Return the heights (n,) of the harmonic function with known values at some points, by linear finite elements.

    Points with the same number in `twin` have one height.
    """
    rows, cols, weights = [], [], []
    for k in range(3):
        a, b, c = faces[:, k], faces[:, (k + 1) % 3], faces[:, (k + 2) % 3]
        u, v = points[a] - points[c], points[b] - points[c]
        area2 = np.maximum(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], 1e-12)
        weight = (u * v).sum(axis=1) / area2 / 2
        rows += [twin[a], twin[b]]
        cols += [twin[b], twin[a]]
        weights += [weight, weight]
    i, j, w = np.concatenate(rows), np.concatenate(cols), np.concatenate(weights)
    n = len(points)
    stiff = (coo_matrix((w, (i, i)), (n, n)) - coo_matrix((w, (i, j)), (n, n))).tocsr()
    fixed = {int(twin[number]): height for number, height in known.items()}
    pinned = np.array(sorted(fixed), dtype=int)
    heights = np.zeros(n)
    heights[pinned] = [fixed[k] for k in pinned.tolist()]
    free = np.setdiff1d(twin, pinned)
    if len(free):
        found = solve_heights(stiff[free][:, free].tocsc(), -stiff[free][:, pinned] @ heights[pinned])
        if not np.isfinite(found).all():
            x, y = points[free[int(np.argmin(np.isfinite(found)))]]
            raise GeometryError(f"floor: no height is known for the workings at ({x:.1f}, {y:.1f})")
        heights[free] = found
    return heights[twin]
