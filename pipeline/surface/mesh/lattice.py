"""The lattice of the rough surface: regular points on walls and arched roof, before displacement."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay, cKDTree
from shapely import Polygon

from pipeline.errors import GeometryError
from pipeline.geometry.rasterize import fill_polygon
from pipeline.surface.mesh.walls import Ring, WallColumns, outline_of, smoothstep
from pipeline.types import Frame

WALL, ROOF = 0, 1
BLEND_M = 0.8  # width of the strip in which the direction turns from the wall's to the roof's
_TOE_SHARE = 0.4  # of the free disc's radius: bound on the floor chamfer in narrow places
_ZIGZAG_M = 1e-4
_BLUR_M = 0.35  # s.d. of the smoothing that rounds the arch's ridge where two walls are nearer than its span


@dataclass(frozen=True)
class CrossSection:
    """Cross-section of the workings, m: height, wall chamfer at the floor, and the arch of the roof."""

    height_m: float
    floor_chamfer_m: float
    arch_rise_m: float
    arch_half_span_m: float


@dataclass(frozen=True)
class Lattice:
    """Points, faces and displacement directions (m, mine frame).

    Vertices are the wall points, with number `row * columns + column`, then the inner points of the roof. `direction`
    (n, 3) are unit vectors into the workings. `roof_share` (n,) is 0 on the walls and rises to 1 on the roof. `column`
    (n,) is the wall column at or nearest to a vertex. `roof_faces` (k, 3) are over wall columns and
    inner points.
    """

    vertices: np.ndarray
    direction: np.ndarray
    roof_share: np.ndarray
    column: np.ndarray
    walls: WallColumns
    rows: int
    roof_faces: np.ndarray

    @property
    def wall_vertices(self) -> int:
        """Return the number of wall vertices, the top row included."""
        return self.rows * len(self.walls.xy)

    @cached_property
    def faces(self) -> np.ndarray:
        """Return the faces (m, 3): those of the walls, then those of the roof."""
        offset = (self.rows - 1) * len(self.walls.xy)  # the first points of the roof are the walls' top row
        roof = self.roof_faces[:, ::-1] + offset
        return np.concatenate([_wall_faces(self.walls, self.rows), roof]).astype(np.int32)

    @cached_property
    def piece(self) -> np.ndarray:
        """Return `WALL` or `ROOF` for each face (m,)."""
        of_walls = 2 * (self.rows - 1) * len(self.walls.xy)
        return np.repeat(np.array([WALL, ROOF], np.uint8), [of_walls, len(self.faces) - of_walls])


def lay_lattice(walls: WallColumns, profile: CrossSection, spacing_m: float, roof_spacing_m: float) -> Lattice:
    """Place points on the walls and the arched roof of the workings.

    The roof starts at the walls' top row, so corners, junctions and islands have no seam. It rises as a parabola over
    `arch_half_span_m` and is level beyond.

    Parameters
    ----------
    walls : WallColumns
    profile : CrossSection
    spacing_m, roof_spacing_m : float
        Greatest distance of neighbouring points up the walls, and in plan on the roof.

    Raises
    ------
    GeometryError
        If two walls are nearer to each other than the spacing.
    """
    xy, inward = walls.xy, walls.inward
    top_m = profile.height_m - profile.arch_rise_m
    levels = np.linspace(0.0, top_m, max(2, int(np.ceil(top_m / spacing_m)) + 1))
    toe = np.minimum(profile.floor_chamfer_m, _TOE_SHARE * walls.free_m)  # the floor chamfer, at 45 deg
    rows = [np.column_stack([xy + np.maximum(0.0, toe - z)[:, None] * inward, np.full(len(xy), z)]) for z in levels]
    grid = _roof_grid(walls, roof_spacing_m)
    inner = grid.xy
    near, column = cKDTree(xy).query(inner, workers=2)
    roof = np.column_stack([inner, _arch(inner, near, profile, roof_spacing_m)])
    share = smoothstep(near / BLEND_M)
    direction = np.column_stack([inward[column] * (1 - share)[:, None], -share])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    flat = np.column_stack([inward, np.zeros(len(xy))])
    return Lattice(
        vertices=np.concatenate([*rows, roof]),
        direction=np.concatenate([np.tile(flat, (len(levels), 1)), direction]),
        roof_share=np.concatenate([np.zeros(len(levels) * len(xy)), share]),
        column=np.concatenate([np.tile(np.arange(len(xy)), len(levels)), column]),
        walls=walls,
        rows=len(levels),
        roof_faces=_roof_faces(walls, grid, roof_spacing_m),
    )


@dataclass(frozen=True)
class _RoofGrid:
    """Points of a square grid in the workings, so far from the walls that all wall lines are edges of a triangulation.

    `xy` (n, 2) m; `distance_m` (n,) to the next wall point; `number` (rows, columns) is a point's number, or -1;
    `origin` (2,) m is the place of the first row and column.
    """

    xy: np.ndarray
    distance_m: np.ndarray
    number: np.ndarray
    origin: np.ndarray


def _roof_grid(walls: WallColumns, spacing_m: float) -> _RoofGrid:
    """Return the grid points of the roof; their numbers follow those of the wall columns."""
    xy, rings = walls.xy, walls.rings
    outline = outline_of(xy, rings)
    west, south, east, north = outline.bounds
    across = np.arange(np.floor(west / spacing_m), np.ceil(east / spacing_m) + 1) * spacing_m
    up = np.arange(np.floor(south / spacing_m), np.ceil(north / spacing_m) + 1) * spacing_m
    # Rounding at the outline does not matter: points so near to it are left out below.
    grid_frame = Frame(1 / spacing_m, 0.5 - across[0] / spacing_m, up[-1] / spacing_m + 0.5, len(across), len(up))
    inside = fill_polygon(outline, grid_frame)[::-1]
    row, col = np.nonzero(inside)
    grid = np.column_stack([across[col], up[row]])
    distance, _ = cKDTree(xy).query(grid, workers=2)
    keep = distance > np.hypot(0.71 * spacing_m, _step_m(rings) / 2)
    number = np.full(inside.shape, -1)
    number[row[keep], col[keep]] = np.arange(keep.sum()) + len(xy)
    return _RoofGrid(grid[keep], distance[keep], number, np.array([across[0], up[0]]))


def _step_m(rings: list[Ring]) -> float:
    """Return the greatest distance of neighbouring wall points, m."""
    return max(r.step_m for r in rings)


def _roof_faces(walls: WallColumns, grid: _RoofGrid, spacing_m: float) -> np.ndarray:
    """Triangulate the workings in plan: faces (m, 3) over wall columns and grid points."""
    xy, rings, number = walls.xy, walls.rings, grid.number
    corners = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    square = np.logical_and.reduce([corner >= 0 for corner in corners])
    a, b, c, d = (corner[square] for corner in corners)
    squares = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    rim = np.flatnonzero(grid.distance_m < 4 * spacing_m + _step_m(rings))
    # A zigzag of 0.1 mm: otherwise three points of a straight wall would make a triangle without area.
    zigzag = xy + np.where(np.arange(len(xy)) % 2, _ZIGZAG_M, 0.0)[:, None] * walls.inward
    points = np.concatenate([zigzag, grid.xy[rim]])
    strip = _strip_faces(points, outline_of(zigzag, rings), rings)
    strip = _outside_squares(points, strip, grid.origin, spacing_m, square)
    return np.concatenate([squares, np.concatenate([np.arange(len(xy)), rim + len(xy)])[strip]])


def _strip_faces(points: np.ndarray, outline: Polygon, rings: list[Ring]) -> np.ndarray:
    """Triangulate points along the walls, counter-clockwise, without the triangles in the rock.

    The walls divide the triangulation into pieces, each of which lies entirely in the workings or in the rock.
    """
    mesh = Delaunay(points)
    faces, neighbour = mesh.simplices.copy(), mesh.neighbors.copy()
    right = np.concatenate([r.first + (np.arange(r.count) + 1) % r.count for r in rings])
    wall = _edge_keys(np.column_stack([np.arange(len(right)), right]), len(points))
    opposite = np.stack([_edge_keys(faces[:, [(k + 1) % 3, (k + 2) % 3]], len(points)) for k in range(3)], axis=1)
    is_wall = np.isin(opposite, wall)
    missing = ~np.isin(wall, opposite[is_wall])
    if missing.any():
        x, y = points[int(missing.argmax())]
        raise GeometryError(
            f"surface: two walls at ({x:.1f}, {y:.1f}) m are nearer to each other than the spacing of the lattice; "
            "use a smaller surface.rough.spacing_m"
        )
    face, side = np.nonzero(~is_wall & (neighbour >= 0))
    joins = coo_array((np.ones(len(face)), (face, neighbour[face, side])), shape=(len(faces), len(faces)))
    pieces, piece = connected_components(joins, directed=False)
    u, v = points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]]
    doubled = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    faces[doubled < 0] = faces[doubled < 0][:, ::-1]
    order = np.lexsort((np.abs(doubled), piece))
    largest = order[np.flatnonzero(np.diff(piece[order], append=pieces))]  # face of each piece
    inside = shapely.contains_xy(outline, *points[faces[largest]].mean(axis=1).T)
    inside[piece[(~is_wall & (neighbour < 0)).any(axis=1)]] = (
        False  # a piece that ends at the hull and not at a wall is rock
    )
    return faces[inside[piece]]


def _edge_keys(edges: np.ndarray, points: int) -> np.ndarray:
    return np.sort(edges, axis=1).astype(np.int64) @ np.array([points, 1])


def _outside_squares(
    points: np.ndarray, faces: np.ndarray, origin: np.ndarray, spacing_m: float, square: np.ndarray
) -> np.ndarray:
    """Return the faces that do not lie in full grid squares, which are already triangulated."""
    col, row = np.floor((points[faces].mean(axis=1) - origin) / spacing_m).astype(int).T
    row, col = np.clip(row, 0, square.shape[0] - 1), np.clip(col, 0, square.shape[1] - 1)
    return faces[~square[row, col]]


def _arch(inner: np.ndarray, near: np.ndarray, profile: CrossSection, spacing_m: float) -> np.ndarray:
    """Return the height (n,) m of the roof over plan points (n, 2) m; `near` (n,) m is their distance from the wall."""
    low = inner.min(axis=0)
    col, row = np.round((inner - low) / spacing_m).astype(int).T
    t = np.minimum(near / profile.arch_half_span_m, 1.0)
    rise = np.zeros((row.max() + 1, col.max() + 1), np.float32)
    weight = np.zeros_like(rise)
    rise[row, col], weight[row, col] = t * (2 - t), 1.0
    sigma = _BLUR_M / spacing_m
    blurred = cv2.GaussianBlur(rise, (0, 0), sigma) / np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-6)
    share = smoothstep(near / BLEND_M)
    smooth = share * blurred[row, col] + (1 - share) * rise[row, col]
    return profile.height_m - profile.arch_rise_m * (1 - smooth)


def _wall_faces(walls: WallColumns, rows: int) -> np.ndarray:
    columns = len(walls.xy)
    left = np.arange(columns)
    right = np.concatenate([r.first + (np.arange(r.count) + 1) % r.count for r in walls.rings])
    low = (np.arange(rows - 1) * columns)[:, None]
    a, b, c, d = ((low + k).ravel() for k in (left, right, columns + right, columns + left))
    # Free space lies to the left of every ring; seen from there, the columns of the wall run from right to left.
    return np.concatenate([np.column_stack([a, c, b]), np.column_stack([a, d, c])])
