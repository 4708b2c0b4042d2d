"""The visible floor: muck with wheel ruts and banks along the ribs, laid a few centimetres over the flat floor."""

from __future__ import annotations

import math

import fast_simplification
import numpy as np
import shapely
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree
from shapely import Polygon

from minexplore.bundle import COVER_M, cover_mesh
from minexplore.looks import TEXTURE_PER_M
from pipeline.geometry.wall_distance import distances_to_walls
from pipeline.mjcf.scene import FloorZone
from pipeline.params.realism import FloorParams
from pipeline.types import DriftNetwork, Mesh

_BEYOND_M = 0.6  # under the rock, whose foot stands that far behind the wall
_TILE_M = 20.0
_STATION_M = 0.25
_MOST_POINTS = 8_000_000  # of the grid over the box; the embedded mine has 3.3 million
_LOWEST_M = 0.006  # above the flat floor, so that the two do not flicker
_LAKE_M = 0.012  # by which the floor of a flooded zone lies lower: about half of it is then under water
_UNDULATIONS_M = ((0.35, 0.35), (1.2, 0.65))  # scale of the unevenness, and its share


def cover_floor(params: FloorParams, free: Polygon, network: DriftNetwork, zones: list[FloorZone]) -> dict[str, Mesh]:
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
    zones : list of FloorZone
    """
    params = _widened(params, free)
    places, cells, shape = _grid(free, params.spacing_m)
    flooded = np.zeros(len(places), bool)
    for zone in (z for z in zones if z.name in params.puddles):
        flooded |= (places[:, 0] >= zone.west_m) & (places[:, 0] <= zone.east_m)
    height = _unevenness(params, shape, places, free) + _banks(params, places, free) - _ruts(params, places, network)
    height = np.clip(params.relief_m + height - _LAKE_M * flooded, _LOWEST_M, COVER_M)
    rim = np.bincount(cells.ravel()) < 4
    height[rim] = _LOWEST_M  # without this slope, simplification would cut the corners of level ground
    corner, faces = np.column_stack([places, height]), _faces(cells)
    vertices, faces = fast_simplification.simplify(
        corner.astype(np.float32), faces.astype(np.int32), target_reduction=1 - params.kept_share
    )
    vertices = np.round(vertices.astype(np.float64), 4)
    vertices[:, 2] = np.clip(vertices[:, 2], _LOWEST_M, COVER_M)
    return _cut(vertices, _upwards(vertices, faces), zones, params.spacing_m)


def _widened(params: FloorParams, free: Polygon) -> FloorParams:
    """Widen the spacing until the grid over the workings' box has at most `_MOST_POINTS`, and print it."""
    west, south, east, north = free.bounds
    least_m = math.sqrt((east - west + 2 * _BEYOND_M) * (north - south + 2 * _BEYOND_M) / _MOST_POINTS)
    if least_m <= params.spacing_m:
        return params
    print(f"realism: points of the visible floor are {least_m:.2f} m apart instead of {params.spacing_m:g} m")
    return params.model_copy(update={"spacing_m": least_m})


def _grid(free: Polygon, spacing_m: float) -> tuple[np.ndarray, np.ndarray, tuple[int, int]]:
    """Return the places (n, 2) m of the grid, the corners (k, 4) of the cells on the floor, and rows and columns."""
    area = free.buffer(_BEYOND_M)
    west, south, east, north = area.bounds
    cols, rows = int(np.ceil((east - west) / spacing_m)) + 1, int(np.ceil((north - south) / spacing_m)) + 1
    row, col = np.indices((rows, cols))
    places = np.stack([west + spacing_m * col, south + spacing_m * row], axis=-1).reshape(-1, 2)
    shapely.prepare(area)
    inside = shapely.contains_xy(area, places[:, 0], places[:, 1]).reshape(rows, cols)
    number = np.arange(rows * cols).reshape(rows, cols)
    corners = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1)
    kept = inside[:-1, :-1] & inside[:-1, 1:] & inside[1:, 1:] & inside[1:, :-1]
    used, cells = np.unique(corners[kept], return_inverse=True)
    return places[used], cells.reshape(-1, 4), (rows, cols)


def _faces(cells: np.ndarray) -> np.ndarray:
    return np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])


def _upwards(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the faces that face up; simplification may fold one on the rim."""
    one, two, three = (vertices[faces[:, k], :2] for k in range(3))
    a, b = two - one, three - one
    return faces[a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > 1e-6]


def _unevenness(params: FloorParams, shape: tuple[int, int], places: np.ndarray, free: Polygon) -> np.ndarray:
    rng = np.random.default_rng(params.seed)
    west, south, _, _ = free.buffer(_BEYOND_M).bounds
    col, row = np.round((places - [west, south]) / params.spacing_m).astype(int).T
    total = np.zeros(len(places))
    for scale_m, share in _UNDULATIONS_M:
        noise = gaussian_filter(rng.standard_normal(shape), scale_m / params.spacing_m, mode="wrap")
        total += share * noise[row, col] / noise.std()
    return 0.35 * params.relief_m * total


def _banks(params: FloorParams, places: np.ndarray, free: Polygon) -> np.ndarray:
    """Return how much higher the floor is towards the ribs, where passing wheels push it."""
    away = distances_to_walls(free, places)
    away[~shapely.contains_xy(free, places[:, 0], places[:, 1])] = 0.0
    share = np.clip(1 - away / params.bank_width_m, 0.0, 1.0)
    return params.bank_m * share * share * (3 - 2 * share)


def _ruts(params: FloorParams, places: np.ndarray, network: DriftNetwork) -> np.ndarray:
    """Return how much lower the floor is in the two wheel tracks along the nearest leg."""
    lines = [shapely.segmentize(shapely.LineString(leg.stations_m), _STATION_M) for leg in network.legs]
    apart = cKDTree(np.concatenate([shapely.get_coordinates(line) for line in lines])).query(places)[0]
    return params.rut_m * np.exp(-(((apart - params.gauge_m / 2) / (params.rut_width_m / 2)) ** 2))


def _cut(vertices: np.ndarray, faces: np.ndarray, zones: list[FloorZone], least_m: float) -> dict[str, Mesh]:
    """Cut the floor into one mesh for each zone and tile; pieces of less than four vertices are dropped."""
    centre = vertices[faces].mean(axis=1)
    edges = [zone.east_m for zone in zones[:-1]]
    zone = np.searchsorted(edges, centre[:, 0], side="right")
    tile = np.floor((centre[:, :2] - vertices[:, :2].min(axis=0)) / _TILE_M).astype(int)
    keys, index = np.unique(np.column_stack([zone, tile]), axis=0, return_inverse=True)
    meshes = {}
    for number, (of_zone, col, row) in enumerate(keys.tolist()):
        used, local = np.unique(faces[index.ravel() == number], return_inverse=True)
        if len(used) >= 4:
            corners = vertices[used]
            local = local.reshape(-1, 3).astype(np.int32)
            meshes[cover_mesh(of_zone, col, row)] = Mesh(corners, local, TEXTURE_PER_M * corners[:, :2])
    return meshes
