"""The walls in plan: columns at even distances along every ring of the free space, and the space around them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d, minimum_filter1d
from scipy.spatial import cKDTree
from shapely import Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from pipeline.geometry.network.skeleton import LEAST_HALF_WIDTH_M, passage_stations
from pipeline.types import DriftNetwork

_FILLET_M = 0.2  # radius to which corners are rounded, so that displaced walls do not cross there
_BLUNT_M, _LEAST_FILLET_M = 0.3, 0.02  # a nose of rock that would lose more than this is rounded less
_SPECK_M2 = 1e-6  # of a nose: smaller pieces come from rounding
TURN_M = 0.4  # s.d. of the smoothing along a wall that turns its direction gradually at corners
_REACH_M = 9.0  # walls farther apart than this do not limit each other's displacement
_OWN_WALL_M = 0.6  # points nearer than this belong to the same piece of wall, unless they face apart
_APART = -0.5  # cosine of the angle between the directions of points that face apart
EVEN_M = 1.0
_PAIRS = 65536  # at a time, so that intermediate arrays stay in the cache
_BORDER, _BORDER_M = 1.25, 0.3  # a wall borders a passage within 1.25 half widths + 0.3 m of its middle


@dataclass(frozen=True)
class Ring:
    """One closed wall line with `count` columns from number `first`, at even distances `step_m`.

    The first ring goes round the mine, further ones go round its pillars.
    """

    first: int
    count: int
    step_m: float


@dataclass(frozen=True)
class WallColumns:
    """Wall columns in plan.

    `xy` (n, 2) m are their places, `inward` (n, 2) unit vectors into the workings. `free_m` and `rock_m` (n,) are radii
    of the largest discs in the workings and in the rock that touch the wall at the column. `passage_m` (n,) is half the
    width of the narrowest passage that the wall borders. In a bay of the wall, the disc is small even if the passage is
    wide. `narrowest_m` is half the width of the mine's narrowest passage, 0 if it is not known.
    """

    xy: np.ndarray
    inward: np.ndarray
    free_m: np.ndarray
    rock_m: np.ndarray
    passage_m: np.ndarray
    rings: list[Ring]
    narrowest_m: float = 0.0


def lay_walls(
    free: Polygon, spacing_m: float, network: DriftNetwork | None = None, thinnest_rock_m: float = _OWN_WALL_M
) -> WallColumns:
    """Place columns along the walls, at most `spacing_m` apart, and measure the space around each.

    Without a drift network, `passage_m` is `free_m`. `thinnest_rock_m` is as for `largest_discs`.
    """
    free = fillet(free)
    rings: list[Ring] = []
    points = []
    for line in (free.exterior, *free.interiors):
        count = max(8, int(np.ceil(line.length / spacing_m)))
        points.append(shapely.get_coordinates(shapely.line_interpolate_point(line, np.arange(count) / count, True)))
        rings.append(Ring(sum(r.count for r in rings), count, line.length / count))
    xy = np.concatenate(points)
    inward = np.concatenate([_inward(xy[r.first : r.first + r.count], r.step_m) for r in rings])
    free_m, rock_m = largest_discs(xy, inward, thinnest_rock_m)
    passage_m = free_m if network is None else passages(xy, free_m, network)
    free_m, rock_m, passage_m = (_smoothed(radius, rings) for radius in (free_m, rock_m, passage_m))
    return WallColumns(xy, inward, free_m, rock_m, passage_m, rings, narrowest_m=narrowest_half_width(network))


def outline_of(xy: np.ndarray, rings: list[Ring]) -> Polygon:
    """Return the polygon through the places (n, 2) m of the columns, ring by ring."""
    outer, *holes = (xy[r.first : r.first + r.count] for r in rings)
    return Polygon(outer, holes)


def smoothstep(t: np.ndarray) -> np.ndarray:
    """Return 3 t^2 - 2 t^3 for t in [0, 1], 0 below and 1 above."""
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3 - 2 * t)


def fillet(free: Polygon) -> Polygon:
    """Round the corners; by a smaller radius if a passage or pillar is too thin for it, and at noses of rock."""
    radius = _FILLET_M
    while radius > _LEAST_FILLET_M:
        rounded = _rounded(free, radius)
        kept = _keep_noses(rounded, free, radius) if _is_like(rounded, free) else rounded
        if _is_like(kept, free):
            return orient(kept)
        radius /= 2
    return orient(free)


def _is_like(rounded: BaseGeometry, free: Polygon) -> bool:
    """Return whether rounded workings are in one piece with the same pillars: thin ones may part or vanish."""
    return isinstance(rounded, Polygon) and len(rounded.interiors) == len(free.interiors)


def _rounded(free: Polygon, radius_m: float) -> BaseGeometry:
    return free.buffer(-radius_m).buffer(2 * radius_m).buffer(-radius_m)


def _keep_noses(rounded: BaseGeometry, free: Polygon, radius_m: float) -> BaseGeometry:
    """Round the noses of rock by smaller radii that have lost more than `_BLUNT_M`.

    Between two drifts that part at an angle a, rounding moves the end of the rock by radius * (1 / sin(a / 2) - 1).
    """
    sharp = [piece for piece in shapely.get_parts(rounded.difference(free)) if _depth_m(piece, rounded) > _BLUNT_M]
    while sharp and radius_m > 2 * _LEAST_FILLET_M:
        radius_m /= 2
        finer = _rounded(free, radius_m)
        rock = rounded.difference(finer).intersection(shapely.union_all(sharp).buffer(_SPECK_M2))
        noses = [part for part in shapely.get_parts(rock) if part.area > _SPECK_M2]
        rounded = rounded.difference(shapely.union_all(noses))
        sharp = [piece for piece in sharp if _depth_m(piece, finer) > _BLUNT_M]
    return rounded


def _depth_m(piece: BaseGeometry, outline: BaseGeometry) -> float:
    """Return how far the corners of a piece lie from an outline, m."""
    return float(shapely.distance(outline.boundary, shapely.points(shapely.get_coordinates(piece))).max(initial=0.0))


def _inward(ring: np.ndarray, step_m: float) -> np.ndarray:
    """Return unit vectors (n, 2) to the left of a closed line, turning gradually at corners."""
    along = np.roll(ring, -1, axis=0) - np.roll(ring, 1, axis=0)
    left = np.column_stack([-along[:, 1], along[:, 0]])
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    smooth = gaussian_filter1d(left, min(TURN_M / step_m, len(ring) / 8), axis=0, mode="wrap")
    return smooth / np.linalg.norm(smooth, axis=1, keepdims=True)


def largest_discs(
    xy: np.ndarray, inward: np.ndarray, thinnest_rock_m: float = _OWN_WALL_M
) -> tuple[np.ndarray, np.ndarray]:
    """Return the radii (n,) m of the largest discs in workings and rock that touch the wall at each column.

    Of points nearer to each other than 0.6 m, those that face apart count, from `thinnest_rock_m`: the two sides of a
    thin wall, or of a column.
    """
    all_pairs = cKDTree(xy).query_pairs(_REACH_M, output_type="ndarray")
    free, rock = np.full(len(xy), _REACH_M / 2), np.full(len(xy), _REACH_M / 2)
    (x, y), (ahead_x, ahead_y) = xy.T, inward.T
    for at in range(0, len(all_pairs), _PAIRS):
        first, second = all_pairs[at : at + _PAIRS].T
        dx, dy = x[second] - x[first], y[second] - y[first]
        squared = dx**2 + dy**2
        faces_apart = ahead_x[first] * ahead_x[second] + ahead_y[first] * ahead_y[second] < _APART
        other_wall = (squared > _OWN_WALL_M**2) | (faces_apart & (squared >= thinnest_rock_m**2))
        first, second, dx, dy, squared = (v[other_wall] for v in (first, second, dx, dy, squared))
        for one, sign in ((first, 1.0), (second, -1.0)):
            ahead = sign * dx * ahead_x[one] + sign * dy * ahead_y[one]
            for radius, side in ((free, ahead), (rock, -ahead)):
                faces = side > 1e-6
                np.minimum.at(radius, one[faces], squared[faces] / (2 * side[faces]))
    return free, rock


def passages(xy: np.ndarray, disc_m: np.ndarray, network: DriftNetwork) -> np.ndarray:
    """Return half the width (n,) m of the narrowest passage that a column borders, or its disc's radius."""
    stations, half = passage_stations(network)
    least = np.full(len(xy), np.inf)
    bordering = cKDTree(xy).query_ball_point(stations, _BORDER * half + _BORDER_M)
    for columns, half_width in zip(bordering, half, strict=True):
        least[columns] = np.minimum(least[columns], half_width)
    return np.where(np.isfinite(least), least, disc_m)


def narrowest_half_width(network: DriftNetwork | None) -> float:
    """Return half the width of the narrowest passage that admits a robot, m, or 0 without a network or a passage."""
    half = passage_stations(network)[1] if network else np.zeros(0)
    half = half[half >= LEAST_HALF_WIDTH_M]
    return float(half.min()) if len(half) else 0.0


def _smoothed(radius: np.ndarray, rings: list[Ring]) -> np.ndarray:
    """Take the minimum over a neighbourhood along each wall, then smooth it over the same neighbourhood."""
    smooth = np.empty_like(radius)
    for ring in rings:
        part = slice(ring.first, ring.first + ring.count)
        reach = min(int(EVEN_M / ring.step_m), (ring.count - 1) // 2)
        least = minimum_filter1d(radius[part], 2 * reach + 1, mode="wrap")
        smooth[part] = gaussian_filter1d(least, max(reach / 3, 0.1), mode="wrap", truncate=3)
    return smooth
