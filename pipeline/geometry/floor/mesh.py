"""The floor's mesh: the workings triangulated about lines of known height, with harmonic heights between the lines."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.spatial import cKDTree
from shapely.geometry.base import BaseGeometry

from pipeline.errors import GeometryError
from pipeline.geometry.floor.solved_heights import solve_heights
from pipeline.geometry.polyline import arc_length
from pipeline.geometry.rock.delaunay import Triangulation
from pipeline.types import FloorMesh

SPACING_M = 3.0  # of the points of a line; a drift is 3 to 6 m wide
_ON_LINE_M, _ON_WALL_M = 0.02, 0.3  # corners nearer than this to a new point take its place
_SQUARE = 1.05  # a line across a drift that is so much longer than the shortest is not square to the walls
_HAIRPIN = 0.0  # cosine of the turn beyond which the drift beside a bend is not level across
_WIDEST_M = 20.0  # beyond this from a line, a wall gets no corner for its points


def build_floor(workings: BaseGeometry, lines: list[np.ndarray], datum_m: float) -> FloorMesh:
    """Triangulate workings about lines of known floor height and find the heights between.

    The heights are harmonic: the lines' heights are kept, and there is no slope across the walls. Along a straight
    drift the floor is then linear between the points of its line and level across. A floor whose lines have one height
    is level and has the corners of the walls alone.

    Parameters
    ----------
    workings : shapely Polygon, m, plan
    lines : list of (k, 3) float64, m
        Where the floor is known; points outside the workings count for the nearest wall, where no nearer one does.
    datum_m : float
        The survey's elevation of height 0.

    Raises
    ------
    GeometryError
        If a piece of the workings has no height; the message names the place.
    """
    # Else results are rounded to the grid that it carries: findings/shapely-grid-of-the-first-shape-counts.sh.
    workings = shapely.set_precision(workings, 0.0)
    mesh = Triangulation(workings)
    given = np.concatenate(lines)
    if np.ptp(given[:, 2]) == 0.0:
        _require_lines(workings, given)
        points, faces = mesh.arrays()
        level = np.column_stack([points, np.full(len(points), given[0, 2])])
        return FloorMesh(level, faces.astype(np.int32), datum_m)
    near: dict[int, list[tuple[float, float]]] = defaultdict(list)
    fine = [_fill(line) for line in lines]
    for line in fine:
        for x, y, z in line.tolist():
            number = mesh.insert((x, y), _ON_LINE_M)
            near[number].append((float(np.hypot(*np.subtract(mesh.xy[number], (x, y)))), z))
    known = defaultdict(list, {number: _nearest(rows) for number, rows in near.items()})
    for foot, height in _feet(workings, fine):
        number = mesh.insert(foot, _ON_WALL_M)
        if height is not None and np.hypot(*np.subtract(mesh.xy[number], foot)) < _ON_LINE_M:
            known[number].append(height)
    points, faces = mesh.arrays()
    heights = _harmonic(points, faces, {number: float(np.mean(rows)) for number, rows in known.items()})
    return FloorMesh(np.column_stack([points, heights]), faces.astype(np.int32), datum_m)


def _require_lines(workings: BaseGeometry, given: np.ndarray) -> None:
    """Refuse workings of which a piece has no point (n, 3) m of a line within it or on its wall."""
    points = shapely.multipoints(given[:, :2])
    for piece in shapely.get_parts(workings):
        if shapely.distance(piece, points) > _ON_WALL_M:
            raise _unknown(shapely.get_coordinates(piece)[0])


def _unknown(place_m: np.ndarray) -> GeometryError:
    x, y = place_m
    return GeometryError(f"floor: no height is known for the workings at ({x:.1f}, {y:.1f})")


def _nearest(rows: list[tuple[float, float]]) -> list[float]:
    """Return the heights of the points that count at a corner, each given with its distance: the nearest ones."""
    least = min(apart for apart, _ in rows)
    return [height for apart, height in rows if apart <= least + _ON_LINE_M]


def _fill(line: np.ndarray) -> np.ndarray:
    """Return a line with further points, no more than the spacing apart."""
    along = arc_length(line[:, :2])
    pieces = [np.linspace(a, b, max(2, int(np.ceil((b - a) / SPACING_M)) + 1))[:-1] for a, b in pairwise(along)]
    at = np.concatenate([*pieces, along[-1:]])
    return np.column_stack([np.interp(at, along, line[:, k]) for k in range(line.shape[1])])


def _feet(workings: BaseGeometry, lines: list[np.ndarray]) -> list[tuple[tuple[float, float], float | None]]:
    """Return where level lines across the drift meet the walls, each with its line's height.

    None stands for the height near junctions and bends.
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
    feet: list[tuple[tuple[float, float], float | None]] = []
    for k, ((x0, y0, z), near_m, hit) in enumerate(zip(start.tolist(), clearance.tolist(), hits, strict=True)):
        places = shapely.get_coordinates(hit)
        if len(places):
            apart = np.hypot(places[:, 0] - x0, places[:, 1] - y0)
            x, y = places[apart.argmin()].tolist()
            own = float(apart.min())
            is_square = own <= _SQUARE * near_m and every.query((x, y))[0] > own / _SQUARE
            is_level = is_square and (line_of[every.query_ball_point((x0, y0), 2 * own)] == line_of[k]).all()
            bend = every.query_ball_point((x0, y0), own + SPACING_M)  # inside a hairpin, walls of both arms meet
            is_level = is_level and (ahead[bend] @ ahead[k] > _HAIRPIN).all()
            feet.append(((x, y), z if is_level else None))
    return feet


def _harmonic(points: np.ndarray, faces: np.ndarray, known: dict[int, float]) -> np.ndarray:
    """Return the heights (n,) of the harmonic function with known values at some points, by linear finite elements."""
    rows, cols, weights = [], [], []
    for k in range(3):
        a, b, c = faces[:, k], faces[:, (k + 1) % 3], faces[:, (k + 2) % 3]
        u, v = points[a] - points[c], points[b] - points[c]
        area2 = np.maximum(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], 1e-12)
        weight = (u * v).sum(axis=1) / area2 / 2
        rows += [a, b]
        cols += [b, a]
        weights += [weight, weight]
    i, j, w = np.concatenate(rows), np.concatenate(cols), np.concatenate(weights)
    n = len(points)
    stiff = (coo_matrix((w, (i, i)), (n, n)) - coo_matrix((w, (i, j)), (n, n))).tocsr()
    pinned = np.array(sorted(known), dtype=int)
    heights = np.zeros(n)
    heights[pinned] = [known[k] for k in pinned.tolist()]
    free = np.setdiff1d(np.arange(n), pinned)
    if len(free):
        found = solve_heights(stiff[free][:, free].tocsc(), -stiff[free][:, pinned] @ heights[pinned])
        if not np.isfinite(found).all():
            raise _unknown(points[free[int(np.argmin(np.isfinite(found)))]])
        heights[free] = found
    return heights
