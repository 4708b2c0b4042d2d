"""The visible floor: muck with wheel ruts and banks along the ribs, laid a few centimetres over the floor."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from minexplore.bundle import COVER_M, cover_mesh
from minexplore.looks import SHADE_LEVELS, TEXTURE_PER_M
from pipeline.mjcf.floor.grid import FloorGrid
from pipeline.mjcf.scene import ZoneStrip
from pipeline.mjcf.simplify import simplify_mesh
from pipeline.params.fittings import FloorParams
from pipeline.types import Mesh

_TILE_M = 20.0
_LOWEST_M = 0.006  # above the flat floor, so that the two do not flicker
_LAKE_M = 0.012  # by which the floor of a flooded zone lies lower: about half of it is then under water
_DAM_M, _DAM_HEIGHT_M = 1.0, 0.004  # water ends so far within its zone, at muck so far above it
_UNDER_WATER_M = 0.004  # the floor is level deeper than that: nobody sees it
_BORDER_M, _BORDER_WAVES_M = 0.15, np.array([1.7, 3.1, 7.3])  # how the line between two zones wanders
_NOISE_POINTS = 1024  # of a square of noise that repeats, 102 m at 0.1 m
_UNDULATIONS_M = ((0.12, 0.24), (0.35, 0.35), (1.2, 0.6))  # scale of the unevenness, and its share
_WANDER_SCALE_M, _WANDER_M, _SHALLOWER = 1.5, 0.08, 0.35  # how ruts wander, and what their depth varies by
_EXAGGERATED, _EXAGGERATED_IN_RIM = 25.0, 5.0  # heights, while the mesh is simplified; by more a rim would move
_STRETCHED = np.array([1.0, 2.5, 1.0, 0.25])  # besides: below the water's level, round it, above it, above all shade
_HEM = 1.0  # length of the wall below a rim, while the mesh is simplified
_BRINK_M = 0.4  # from a drop, within which the floor sinks to its lowest
_SUNK_M = (0.15, 0.4)  # behind the wall the floor sinks, unseen; simplification cuts corners of the level rest


def cover_floor(params: FloorParams, grid: FloorGrid, zones: list[ZoneStrip]) -> dict[str, Mesh]:
    """Return the meshes of the visible floor by name, m, mine frame; nothing of them collides.

    The floor is uneven by noise, rises to a bank along the ribs and has two ruts along every drift. It lies between 0
    and `COVER_M` above the floor that wheels touch: a wheel sinks in by what a loose floor would give way. A mesh
    belongs to one zone and one tile.
    """
    vertices, faces = _simplified(params, grid, _uneven(params, grid, zones))
    faces = _upwards(vertices, faces)
    return _cut(vertices, faces, zones)


def _uneven(params: FloorParams, grid: FloorGrid, zones: list[ZoneStrip]) -> np.ndarray:
    """Return the height (n,) m of the visible floor above each point of a grid."""
    noise = _Noise(params.seed, grid)
    uneven = 0.35 * params.relief_m * sum(share * noise.of(scale_m) for scale_m, share in _UNDULATIONS_M)
    wander = noise.of(_WANDER_SCALE_M)
    height = params.relief_m + uneven + _banks(params, grid) - _ruts(params, grid, wander)
    height = _flooded(params, grid, height, zones, wander)
    return np.clip(_sunk_at_ends(grid, height), _LOWEST_M, COVER_M)


def _simplified(params: FloorParams, grid: FloorGrid, height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return fewer vertices and faces.

    Heights are drawn apart before, most where water ends and shade begins, and put back after: by their true heights
    of centimetres all faces are level, and the simplification would cut across the borders of ruts and puddles. Below
    a rim hangs a wall as long as faces are taken away, without which the mesh would shrink there.
    """
    drawn_apart = _EXAGGERATED_IN_RIM if len(grid.rim) else _EXAGGERATED
    shore, top = params.water_m * np.array([0.85, 1.15]), params.water_m * SHADE_LEVELS[-1]
    true_m = np.array([0.0, *shore, top, max(COVER_M, top + _LOWEST_M)])
    apart_m = drawn_apart * np.cumsum([0.0, *(_STRETCHED * np.diff(true_m))])
    drawn_m = np.interp(height, true_m, apart_m) + drawn_apart * grid.points_m[:, 2]
    drawn, faces = _with_hem(np.column_stack([grid.points_m[:, :2], drawn_m]), grid)
    origin = np.array([*grid.points_m[:, :2].mean(axis=0).round(), 0.0])  # 32 bits have few digits far from it
    vertices, faces = simplify_mesh((drawn - origin).astype(np.float32), faces, 1 - params.kept_share)
    vertices = vertices.astype(np.float64) + origin
    floor_m = grid.floors_m(vertices / [1.0, 1.0, drawn_apart])
    over = vertices[:, 2] - drawn_apart * floor_m
    vertices[:, 2] = floor_m + np.clip(np.interp(over, apart_m, true_m), _LOWEST_M, COVER_M)
    return np.round(vertices, 4), faces[(over[faces] > -_HEM / 2).all(axis=1)]


def _with_hem(drawn: np.ndarray, grid: FloorGrid) -> tuple[np.ndarray, np.ndarray]:
    """Return the points and faces of a grid with a wall that hangs below its rim."""
    top, rim = np.unique(grid.rim, return_inverse=True)
    a, b = grid.rim.T
    below_a, below_b = (len(drawn) + rim.reshape(-1, 2)).T
    hem = np.concatenate([np.column_stack([b, a, below_a]), np.column_stack([b, below_a, below_b])])
    points = np.concatenate([drawn, drawn[top] - [0.0, 0.0, _HEM]])
    return points, np.concatenate([grid.faces, hem.astype(np.int32)])


def _upwards(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the faces that face up; simplification may fold one on the rim."""
    one, two, three = (vertices[faces[:, k], :2] for k in range(3))
    a, b = two - one, three - one
    return faces[a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > 1e-6]


class _Noise:
    """Noise at the points of a grid, from one square of white noise that repeats without a seam."""

    def __init__(self, seed: int, grid: FloorGrid) -> None:
        """Draw the white noise."""
        self._spacing_m = grid.spacing_m
        self._rng = np.random.default_rng(seed)
        self._col, self._row = grid.pixels.T % _NOISE_POINTS

    def of(self, scale_m: float) -> np.ndarray:
        """Return new noise (n,) of deviation 1, smooth over a scale."""
        white = self._rng.standard_normal((_NOISE_POINTS, _NOISE_POINTS))
        noise = gaussian_filter(white, scale_m / self._spacing_m, mode="wrap")
        return np.asarray(noise[self._row, self._col] / noise.std())


def _smooth_step(share: np.ndarray) -> np.ndarray:
    share = np.clip(share, 0.0, 1.0)
    return np.asarray(share * share * (3 - 2 * share))


def _near(points_m: np.ndarray, places: np.ndarray, reach_m: float) -> np.ndarray:
    """Return the distances (n,) m of places from points; infinite beyond a reach."""
    return np.asarray(cKDTree(points_m).query(places, distance_upper_bound=reach_m)[0])


def _banks(params: FloorParams, grid: FloorGrid) -> np.ndarray:
    """Return how much higher the floor is towards the ribs, where passing wheels push it, and behind them."""
    away = np.zeros(len(grid.points_m))
    away[grid.is_inside] = _near(grid.walls_m, grid.points_m[grid.is_inside], params.bank_width_m)
    return params.bank_m * _smooth_step(1 - away / params.bank_width_m)


def _sunk_at_ends(grid: FloorGrid, height: np.ndarray) -> np.ndarray:
    """Lower the floor to its lowest at brinks and behind walls, where simplification would cut into the drift."""
    far = ~grid.is_inside
    behind_m = np.minimum(_near(grid.walls_m, grid.points_m[far], 1.0), 1.0)
    sunk = _smooth_step((behind_m - _SUNK_M[0]) / (_SUNK_M[1] - _SUNK_M[0]))
    height[far] += sunk * (_LOWEST_M - height[far])
    if len(grid.brinks_m):
        kept = _smooth_step(np.minimum(_near(grid.brinks_m, grid.points_m, _BRINK_M) / _BRINK_M, 1.0))
        height = _LOWEST_M + kept * (height - _LOWEST_M)
    return height


def _ruts(params: FloorParams, grid: FloorGrid, wander: np.ndarray) -> np.ndarray:
    """Return how much lower the floor is in the two wheel tracks along the nearest leg, which wander by a noise."""
    apart = _near(grid.ruts_m, grid.points_m, params.gauge_m)
    across = (apart - params.gauge_m / 2 + _WANDER_M * wander) / (params.rut_width_m / 2)
    return params.rut_m * (1 - _SHALLOWER * np.clip(wander, -1, 1)) * np.exp(-(across**2))


def _flooded(
    params: FloorParams, grid: FloorGrid, height: np.ndarray, zones: list[ZoneStrip], wander: np.ndarray
) -> np.ndarray:
    """Lower level floors of flooded zones, and raise them towards their ends, so that water ends at a shore."""
    east_m = grid.points_m[:, 0] + 0.15 * _DAM_M * wander
    for zone in (z for z in zones if z.name in params.puddles):
        inside = (grid.points_m[:, 0] >= zone.west_m) & (grid.points_m[:, 0] <= zone.east_m) & (grid.shore_m >= 0)
        within_m = np.minimum(np.minimum(east_m - zone.west_m, zone.east_m - east_m), grid.shore_m)
        lake = height - _LAKE_M * _smooth_step(within_m / _DAM_M)
        dam = np.maximum(lake, params.water_m + _DAM_HEIGHT_M)
        open_share = _smooth_step(np.abs(within_m) / _DAM_M - 0.25)
        height = open_share * lake + (1 - open_share) * dam
        height[inside] = np.maximum(height[inside], params.water_m - _UNDER_WATER_M)
    return height


def _split(
    vertices: np.ndarray, faces: np.ndarray, side: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Split faces where `side` (n,) of their corners changes its sign.

    Returns the vertices, the faces, whether each lies on the positive side, and the number of the face it is from.
    """
    above = side > 0
    crossed = above[faces].any(axis=1) & ~above[faces].all(axis=1)
    whole, cut = faces[~crossed], faces[crossed]
    alone = above[cut] == (above[cut].sum(axis=1) == 1)[:, None]  # the corner on a side of its own comes first
    a, b, c = cut[np.arange(len(cut))[:, None], (alone.argmax(axis=1)[:, None] + np.arange(3)) % 3].T
    edges = np.sort(np.concatenate([np.column_stack([a, b]), np.column_stack([a, c])]), axis=1)
    edges, index = np.unique(edges, axis=0, return_inverse=True)
    p, q = (len(vertices) + part for part in np.split(index.ravel(), 2))
    share = side[edges[:, :1]] / (side[edges[:, :1]] - side[edges[:, 1:]])
    points = np.round(vertices[edges[:, 0]] + share * (vertices[edges[:, 1]] - vertices[edges[:, 0]]), 4)
    pieces = np.concatenate([np.column_stack(piece) for piece in ((a, p, q), (p, b, c), (p, c, q))])
    east = np.concatenate([above[whole].any(axis=1), above[a], ~above[a], ~above[a]])
    origin = np.concatenate([np.flatnonzero(~crossed), *[np.flatnonzero(crossed)] * 3])
    return np.concatenate([vertices, points]), np.concatenate([whole, pieces]), east, origin


def cut_by_zones(
    vertices: np.ndarray, faces: np.ndarray, zones: list[ZoneStrip], wander_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices (n, 3) m and faces (f, 3) cut where zones meet, and each face's zone by number.

    Zones meet on lines that wander by so many m times three sines.
    """
    zone = np.zeros(len(faces), int)
    for border in (zone.east_m for zone in zones[:-1]):
        place = vertices[:, :2]
        wander = np.sin(2 * np.pi * np.outer(place[:, 1], 1 / _BORDER_WAVES_M)).sum(axis=1)
        vertices, faces, east, origin = _split(vertices, faces, place[:, 0] - border - wander_m * wander)
        zone = zone[origin] + east
    return vertices, faces, zone


def _cut(vertices: np.ndarray, faces: np.ndarray, zones: list[ZoneStrip]) -> dict[str, Mesh]:
    """Cut the floor into one mesh for each zone and tile; pieces of less than four vertices are dropped.

    Zones meet on a line that wanders to both sides of their border.
    """
    vertices, faces, zone = cut_by_zones(vertices, faces, zones, _BORDER_M)
    centre = vertices[faces].mean(axis=1)
    tile = np.floor((centre[:, :2] - vertices[:, :2].min(axis=0)) / _TILE_M).astype(int)
    keys, index = np.unique(np.column_stack([zone, tile]), axis=0, return_inverse=True)
    meshes = {}
    for number, (of_zone, col, row) in enumerate(keys.tolist()):
        used, local = np.unique(faces[index.ravel() == number], return_inverse=True)
        if len(used) >= 4:
            corners = vertices[used]
            local = local.reshape(-1, 3).astype(np.int32)
            laid = TEXTURE_PER_M * corners[:, :2]
            meshes[cover_mesh(of_zone, col, row)] = Mesh(corners.round(4), local, laid)
    return meshes
