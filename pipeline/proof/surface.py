"""The work of stage 6 on the rock's shape: sample the meshes of the MJCF, and report walls and relief."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from shapely import MultiPolygon, Polygon

from minexplore.bundle import ROOF, WALLS
from pipeline.metrics.clearance import WallGaps, measure_walls
from pipeline.metrics.rock.relief import Relief, measure_relief
from pipeline.metrics.rock.sampling import faces_near, sample_triangles
from pipeline.mjcf.visible import Visible, smooth_triangles, visible_triangles
from pipeline.types import DriftNetwork

_BAND_M = 0.05  # half height of the band of wall around a height
_FOOT_M = 0.05  # the band then begins at the floor
_WALL_POINTS = 400_000
_MOST_FACES = 2_000_000
_FLAT_RADIUS_M = 4.0


@dataclass(frozen=True)
class Drifts:
    """Drifts seen from above: their walls and, evenly spaced along them, stations.

    Attributes
    ----------
    free : shapely.Polygon or shapely.MultiPolygon, m
    stations_m : (n, 2) float64
    half_width_m : (n,) float64
    length_m : float
        Of all drifts.
    """

    free: Polygon | MultiPolygon
    stations_m: np.ndarray
    half_width_m: np.ndarray
    length_m: float


@dataclass(frozen=True)
class SeenRock:
    """Visible rock over a level floor at z = 0, along its drifts.

    `rough` and `smooth` return the triangles (n, 3, 3) m of a piece, walls or roof, as it is seen and without relief;
    `plumb` those of walls that are plumb without relief, and unit normals (n, 3) of these walls; None where all are.
    """

    rough: Callable[[str], np.ndarray]
    smooth: Callable[[str], np.ndarray]
    drifts: Drifts
    plumb: Callable[[], tuple[np.ndarray, np.ndarray]] | None = None


def drifts_of(free: Polygon | MultiPolygon, network: DriftNetwork) -> Drifts:
    """Return the drifts of a level mine, of its workings, m, and their network."""
    return Drifts(
        free,
        np.array([place for leg in network.legs for place in leg.stations_m]),
        np.array([half_m for leg in network.legs for half_m in leg.half_width_m]),
        network.total_length_m,
    )


def level_rock(visible: Visible, free: Polygon | MultiPolygon, network: DriftNetwork) -> SeenRock:
    """Return the visible rock of a level mine."""
    return SeenRock(partial(visible_triangles, visible), partial(smooth_triangles, visible), drifts_of(free, network))


@dataclass(frozen=True)
class WallBands:
    """Visible rock against collision walls at the robot's height, and just over the floor, where blocks lean out."""

    at_height: WallGaps
    at_foot: WallGaps


def report_walls(
    visible: Visible,
    free: Polygon,
    network: DriftNetwork,
    height_m: float,
    seed: int,
) -> WallBands:
    """Compare the visible walls at a height and 5 cm over the floor with the collision walls on the outline."""
    walls = visible_triangles(visible, WALLS)
    return WallBands(*(_gaps_at(walls, free, network, height, seed) for height in (height_m, _FOOT_M)))


def _gaps_at(
    walls: np.ndarray,
    free: Polygon,
    network: DriftNetwork,
    height_m: float,
    seed: int,
) -> WallGaps:
    z = walls[:, :, 2]
    band = walls[(z.max(axis=1) > height_m - _BAND_M) & (z.min(axis=1) < height_m + _BAND_M)]
    points, _ = sample_triangles(split_long(band), _WALL_POINTS, np.random.default_rng(seed))
    return measure_walls(between(points, (height_m - _BAND_M, height_m + _BAND_M))[:, :2], free, network)


def walls_metrics(walls: WallBands) -> dict[str, Any]:
    """Return the figures at the robot's height, and the gaps over the floor under `at_5_cm`."""
    foot = {name: value for name, value in vars(walls.at_foot).items() if name.startswith("gap_")}
    return {**vars(walls.at_height), f"at_{100 * _FOOT_M:.0f}_cm": foot}


def report_relief(rock: SeenRock, stretches: int) -> Relief:
    """Measure the shape of the visible walls of a world along the walls of its drifts."""
    plumb = rock.plumb() if rock.plumb else None
    return relief_of(rock.rough(WALLS), rock.rough(ROOF), rock.drifts, stretches, plumb)


def relief_of(
    walls: np.ndarray,
    roof: np.ndarray,
    drifts: Drifts,
    stretches: int,
    plumb: tuple[np.ndarray, np.ndarray] | None = None,
) -> Relief:
    """Measure walls (n, 3, 3) m; `plumb` as in `measure_relief`.

    Flat faces are searched in walls and roof near evenly spaced stations.
    """
    places = stretch_centres(drifts, stretches)
    sample = np.concatenate([faces_near(piece, places, _FLAT_RADIUS_M) for piece in (walls, roof)])
    return measure_relief(walls, sample, drifts.free, plumb=plumb)


def stretch_centres(drifts: Drifts, count: int) -> np.ndarray:
    """Return `count` places (n, 2), m, spaced evenly over all stations, without the first and the last."""
    stations = drifts.stations_m
    return stations[np.linspace(0, len(stations) - 1, count + 2).round().astype(int)[1:-1]]


def split_long(triangles: np.ndarray, longest_m: float = 3.0) -> np.ndarray:
    """Split triangles until no side is longer than `longest_m`, so that a centre locates each triangle.

    It stops at two million triangles, so that a mesh in wrong units does not exhaust the memory.
    """
    while 0 < len(triangles) < _MOST_FACES:
        # Rounded: sides tie, and the last digit, which differs between processors, would choose.
        sides = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2).round(6)
        long = sides.max(axis=1) > longest_m
        if not long.any():
            break
        at = sides[long].argmax(axis=1)[:, None]
        a, b, c = (np.take_along_axis(triangles[long], ((at + k) % 3)[:, :, None], axis=1)[:, 0] for k in range(3))
        middle = (a + b) / 2
        halves = np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)
        triangles = np.concatenate([triangles[~long], *halves])
    return triangles


def between(points: np.ndarray, z_m: tuple[float, float]) -> np.ndarray:
    """Return the points (n, 3) m whose heights lie in a range, ends included."""
    return points[(points[:, 2] >= z_m[0]) & (points[:, 2] <= z_m[1])]
