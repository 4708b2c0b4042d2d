"""The visible floor: muck with wheel ruts and banks along the ribs, laid a few centimetres over the flat floor."""

from __future__ import annotations

import math

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from minesurveys.remarks import warn_user
from minexplore.bundle import COVER_M, cover_mesh
from minexplore.looks import SHADE_LEVELS, TEXTURE_PER_M
from pipeline.geometry.rasterize import fill_polygon
from pipeline.mjcf.scene import ZoneStrip
from pipeline.mjcf.simplify import simplify_mesh
from pipeline.params.fittings import FloorParams
from pipeline.types import DriftNetwork, Frame, Mesh

_BEYOND_M = 0.6  # under the rock, whose foot stands that far behind the wall
_TILE_M = 20.0
_STATION_M = 0.1  # between the points of a wall or a leg that distances are measured from
_MOST_POINTS = 16_000_000  # of the grid over the box; the embedded mine has 13 million
_MOST_ON_FLOOR = 2_000_000  # of them; 700 bytes each while the floor is simplified; the embedded mine has 1.2 million
_LOWEST_M = 0.006  # above the flat floor, so that the two do not flicker
_LAKE_M = 0.012  # by which the floor of a flooded zone lies lower: about half of it is then under water
_DAM_M, _DAM_HEIGHT_M = 1.0, 0.004  # water ends so far within its zone, at muck so far above it
_UNDER_WATER_M = 0.004  # the floor is level deeper than that: nobody sees it
_BORDER_M, _BORDER_WAVES_M = 0.15, np.array([1.7, 3.1, 7.3])  # how the line between two zones wanders
_NOISE_POINTS = 1024  # of a square of noise that repeats, 102 m at 0.1 m
_UNDULATIONS_M = ((0.12, 0.24), (0.35, 0.35), (1.2, 0.6))  # scale of the unevenness, and its share
_WANDER_SCALE_M, _WANDER_M, _SHALLOWER = 1.5, 0.08, 0.35  # how ruts wander, and what their depth varies by
_EXAGGERATED = 25.0  # heights, while the mesh is simplified
_STRETCHED = np.array([1.0, 2.5, 1.0, 0.25])  # besides: below the water's level, round it, above it, above all shade
_SUNK_M = (0.15, 0.4)  # behind the wall the floor sinks, unseen; simplification cuts corners of the level rest


def cover_floor(
    params: FloorParams,
    free: Polygon,
    network: DriftNetwork,
    zones: list[ZoneStrip],
) -> dict[str, Mesh]:
    """Return the meshes of the visible floor by name, m, mine frame; nothing of them collides.

    The floor is uneven by noise, rises to a bank along the ribs and has two ruts along every drift. It lies between 0
    and `COVER_M` above the flat floor that wheels touch: a wheel sinks in by what a loose floor would give way. A mesh
    belongs to one zone and one tile.

    Parameters
    ----------
    params : FloorParams
    free : shapely.Polygon, m
    network : DriftNetwork
        Ruts follow its legs.
    zones : list of ZoneStrip
    """
    corners, cells = _uneven_grid(params, free, network, zones)
    vertices, faces = _simplified(params, corners, cells)
    faces = _upwards(vertices, faces)
    return _cut(vertices, faces, zones)


def _uneven_grid(
    params: FloorParams, free: Polygon, network: DriftNetwork, zones: list[ZoneStrip]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners (n, 3) m of the floor's grid, and its cells (k, 4)."""
    # An outline of stage 2 carries the grid that it was rounded to, and would round the band round it to that.
    free = shapely.set_precision(free, 0.0)
    params = _widened(params, free)
    frame = _frame(free, params.spacing_m)
    pixels, cells = _grid(free.buffer(_BEYOND_M), frame)
    places = frame.to_mine(pixels + 0.5)
    noise = _Noise(params, pixels)
    uneven = 0.35 * params.relief_m * sum(share * noise.of(scale_m) for scale_m, share in _UNDULATIONS_M)
    wander = noise.of(_WANDER_SCALE_M)
    walls = list(shapely.get_parts(free.boundary))
    inside = shapely.contains_xy(free, places[:, 0], places[:, 1])
    banks = _banks(params, walls, places, inside)
    height = params.relief_m + uneven + banks - _ruts(params, places, network, wander)
    height = _flooded(params, places, height, zones, wander)
    height = np.clip(_sunk_under_rock(walls, places, height, ~inside), _LOWEST_M, COVER_M)
    return np.column_stack([places, height]), cells


def _simplified(params: FloorParams, corner: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return fewer vertices and faces.

    Heights are drawn apart before, most where water ends and shade begins, and put back after: by their true heights
    of centimetres all faces are level, and the simplification would cut across the borders of ruts and puddles.
    """
    shore, top = params.water_m * np.array([0.85, 1.15]), params.water_m * SHADE_LEVELS[-1]
    true_m = np.array([0.0, *shore, top, max(COVER_M, top + _LOWEST_M)])
    apart_m = _EXAGGERATED * np.cumsum([0.0, *(_STRETCHED * np.diff(true_m))])
    drawn = np.column_stack([corner[:, :2], np.interp(corner[:, 2], true_m, apart_m)])
    origin = np.array([*corner[:, :2].mean(axis=0).round(), 0.0])  # 32 bits have few digits far from it
    lowered = (drawn - origin).astype(np.float32)
    vertices, faces = simplify_mesh(lowered, _faces(cells.astype(np.int32)), 1 - params.kept_share)
    vertices = vertices.astype(np.float64) + origin
    vertices[:, 2] = np.clip(np.interp(vertices[:, 2], apart_m, true_m), _LOWEST_M, COVER_M)
    return np.round(vertices, 4), faces


def _widened(params: FloorParams, free: Polygon) -> FloorParams:
    """Widen the spacing until the grid has at most so many points over the workings' box and on the floor; print it."""
    west, south, east, north = free.bounds
    box_m2, floor_m2 = (east - west + 2 * _BEYOND_M) * (north - south + 2 * _BEYOND_M), free.buffer(_BEYOND_M).area
    least_m = math.sqrt(max(box_m2 / _MOST_POINTS, floor_m2 / _MOST_ON_FLOOR))
    if least_m <= params.spacing_m:
        return params
    warn_user(f"points of the visible floor are {least_m:.2f} m apart instead of {params.spacing_m:g} m", of="realism")
    return params.model_copy(update={"spacing_m": least_m})


def _frame(free: Polygon, spacing_m: float) -> Frame:
    """Return the grid of points, as pixels' centres, over the workings and the rock's foot."""
    west, south, east, north = free.buffer(_BEYOND_M).bounds
    cols, rows = (int(np.ceil(length / spacing_m)) + 1 for length in (east - west, north - south))
    return Frame(1 / spacing_m, -west / spacing_m, north / spacing_m, cols, rows)


def _grid(covered: BaseGeometry, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels (n, 2), column and row, on the floor, and the corners (k, 4) of the cells between them."""
    inside = fill_polygon(covered, frame)
    kept = inside[:-1, :-1] & inside[:-1, 1:] & inside[1:, 1:] & inside[1:, :-1]
    used = np.zeros_like(inside)
    first, last = slice(-1), slice(1, None)
    for rows, cols in ((first, first), (first, last), (last, first), (last, last)):
        used[rows, cols] |= kept
    row, col = np.nonzero(used)
    number = np.zeros(inside.shape, np.int32)
    number[row, col] = np.arange(len(row))
    r, c = np.nonzero(kept)
    cells = np.column_stack([number[r + 1, c], number[r + 1, c + 1], number[r, c + 1], number[r, c]])
    return np.column_stack([col, row]), cells  # from the south-west, against the clock


def _faces(cells: np.ndarray) -> np.ndarray:
    return np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])


def _upwards(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the faces that face up; simplification may fold one on the rim."""
    one, two, three = (vertices[faces[:, k], :2] for k in range(3))
    a, b = two - one, three - one
    return faces[a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > 1e-6]


class _Noise:
    """Noise at the points of a grid, from one square of white noise that repeats without a seam."""

    def __init__(self, params: FloorParams, pixels: np.ndarray) -> None:
        """Draw the white noise."""
        self._spacing_m = params.spacing_m
        self._rng = np.random.default_rng(params.seed)
        self._col, self._row = pixels.T % _NOISE_POINTS

    def of(self, scale_m: float) -> np.ndarray:
        """Return new noise (n,) of deviation 1, smooth over a scale."""
        white = self._rng.standard_normal((_NOISE_POINTS, _NOISE_POINTS))
        noise = gaussian_filter(white, scale_m / self._spacing_m, mode="wrap")
        return np.asarray(noise[self._row, self._col] / noise.std())


def _smooth_step(share: np.ndarray) -> np.ndarray:
    share = np.clip(share, 0.0, 1.0)
    return np.asarray(share * share * (3 - 2 * share))


def _near(lines: list, places: np.ndarray, reach_m: float) -> np.ndarray:
    """Return the distances (n,) m of places from lines; infinite beyond a reach."""
    points = np.concatenate([shapely.get_coordinates(shapely.segmentize(line, _STATION_M)) for line in lines])
    return np.asarray(cKDTree(points).query(places, distance_upper_bound=reach_m)[0])


def _banks(params: FloorParams, walls: list[BaseGeometry], places: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Return how much higher the floor is towards the ribs, where passing wheels push it, and behind them."""
    away = np.zeros(len(places))
    away[inside] = _near(walls, places[inside], params.bank_width_m)
    return params.bank_m * _smooth_step(1 - away / params.bank_width_m)


def _sunk_under_rock(walls: list[BaseGeometry], places: np.ndarray, height: np.ndarray, far: np.ndarray) -> np.ndarray:
    """Lower the floor behind the walls to its lowest; without this slope simplification would cut into the drift."""
    behind_m = np.minimum(_near(walls, places[far], 1.0), 1.0)
    sunk = _smooth_step((behind_m - _SUNK_M[0]) / (_SUNK_M[1] - _SUNK_M[0]))
    height[far] += sunk * (_LOWEST_M - height[far])
    return height


def _ruts(params: FloorParams, places: np.ndarray, network: DriftNetwork, wander: np.ndarray) -> np.ndarray:
    """Return how much lower the floor is in the two wheel tracks along the nearest leg, which wander by a noise."""
    lines = [shapely.LineString(leg.stations_m) for leg in network.legs if len(set(leg.stations_m)) > 1]
    apart = _near(lines, places, params.gauge_m)
    across = (apart - params.gauge_m / 2 + _WANDER_M * wander) / (params.rut_width_m / 2)
    return params.rut_m * (1 - _SHALLOWER * np.clip(wander, -1, 1)) * np.exp(-(across**2))


def _flooded(
    params: FloorParams, places: np.ndarray, height: np.ndarray, zones: list[ZoneStrip], wander: np.ndarray
) -> np.ndarray:
    """Lower the floor of flooded zones, and raise it towards their ends, so that water ends at a shore."""
    east_m = places[:, 0] + 0.15 * _DAM_M * wander
    for zone in (z for z in zones if z.name in params.puddles):
        inside = (places[:, 0] >= zone.west_m) & (places[:, 0] <= zone.east_m)
        within_m = np.minimum(east_m - zone.west_m, zone.east_m - east_m)
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


def _cut(vertices: np.ndarray, faces: np.ndarray, zones: list[ZoneStrip]) -> dict[str, Mesh]:
    """Cut the floor into one mesh for each zone and tile; pieces of less than four vertices are dropped.

    Zones meet on a line that wanders to both sides of their border.
    """
    zone = np.zeros(len(faces), int)
    for border in (zone.east_m for zone in zones[:-1]):
        place = vertices[:, :2]
        wander = np.sin(2 * np.pi * np.outer(place[:, 1], 1 / _BORDER_WAVES_M)).sum(axis=1)
        vertices, faces, east, origin = _split(vertices, faces, place[:, 0] - border - _BORDER_M * wander)
        zone = zone[origin] + east
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
