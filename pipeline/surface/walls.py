"""The walls in plan: columns at even distances round every ring of the free space, and the room they have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d, minimum_filter1d
from scipy.spatial import cKDTree
from shapely import Polygon
from shapely.geometry.polygon import orient

from pipeline.geometry.skeleton import passage_stations
from pipeline.types import DriftNetwork

_FILLET_M = 0.2  # corners are rounded by this much, so that displaced walls have room to turn
_TURN_M = 0.4  # s.d. of the smoothing along a wall that turns its direction gradually at corners
_REACH_M = 9.0  # walls farther than this are out of each other's way
_OWN_WALL_M = 0.6  # points nearer than this belong to the same piece of wall
_EVEN_M = 1.0
_BESIDE, _BESIDE_M = 1.25, 0.3  # a wall borders a passage if no farther from its middle than half the width and this


@dataclass(frozen=True)
class Ring:
    """One closed wall line: its columns are `first .. first + count`, at even distances `step_m`."""

    first: int
    count: int
    step_m: float


@dataclass(frozen=True)
class Walls:
    """Wall columns in plan.

    Places `xy` (n, 2) m, unit vectors `inward` (n, 2) into the workings, and (n,) m: the largest discs in the workings
    and in the rock that touch the wall there, `free_m` and `rock_m`, and half the width of the narrowest passage that
    the wall borders, `passage_m`. In a bay of a rough surface wall the disc is small, however wide the passage.
    """

    xy: np.ndarray
    inward: np.ndarray
    free_m: np.ndarray
    rock_m: np.ndarray
    passage_m: np.ndarray
    rings: list[Ring]


def lay_walls(free: Polygon, spacing_m: float, network: DriftNetwork | None = None) -> Walls:
    """Lay columns round the free space, at most `spacing_m` apart, and measure the room at each.

    Without a drift network, a wall's passage is as wide as its disc.
    """
    free = _fillet(free)
    rings: list[Ring] = []
    points = []
    for line in (free.exterior, *free.interiors):
        count = max(8, int(np.ceil(line.length / spacing_m)))
        points.append(shapely.get_coordinates(shapely.line_interpolate_point(line, np.arange(count) / count, True)))
        rings.append(Ring(sum(r.count for r in rings), count, line.length / count))
    xy = np.concatenate(points)
    inward = np.concatenate([_inward(xy[r.first : r.first + r.count], r.step_m) for r in rings])
    clear_m, rock_m = _largest_discs(xy, inward)
    passage_m = clear_m if network is None else _passages(xy, clear_m, network)
    return Walls(xy, inward, _evened(clear_m, rings), _evened(rock_m, rings), _evened(passage_m, rings), rings)


def outline_of(xy: np.ndarray, rings: list[Ring]) -> Polygon:
    """Return the polygon whose rings pass through the columns' places (n, 2) m."""
    outer, *holes = (xy[r.first : r.first + r.count] for r in rings)
    return Polygon(outer, holes)


def smoothstep(t: np.ndarray) -> np.ndarray:
    """Return 0 up to t = 0, 1 from t = 1, and 3 t^2 - 2 t^3 between."""
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3 - 2 * t)


def _fillet(free: Polygon) -> Polygon:
    """Round the corners; less where a passage or pillar is too thin for it."""
    radius = _FILLET_M
    while radius > 0.02:
        rounded = free.buffer(-radius).buffer(2 * radius).buffer(-radius)
        if rounded.geom_type == "Polygon" and len(rounded.interiors) == len(free.interiors):
            return orient(rounded)
        radius /= 2
    return orient(free)


def _inward(ring: np.ndarray, step_m: float) -> np.ndarray:
    """Return unit vectors (n, 2) to the left of a closed line, turning gradually at corners."""
    along = np.roll(ring, -1, axis=0) - np.roll(ring, 1, axis=0)
    left = np.column_stack([-along[:, 1], along[:, 0]])
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    smooth = gaussian_filter1d(left, min(_TURN_M / step_m, len(ring) / 8), axis=0, mode="wrap")
    return smooth / np.linalg.norm(smooth, axis=1, keepdims=True)


def _largest_discs(xy: np.ndarray, inward: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the radii (n,) m of the largest discs in the workings and in the rock that touch the wall at a column."""
    pairs = cKDTree(xy).query_pairs(_REACH_M, output_type="ndarray")
    free, rock = np.full(len(xy), _REACH_M / 2), np.full(len(xy), _REACH_M / 2)
    for one, two in ((pairs[:, 0], pairs[:, 1]), (pairs[:, 1], pairs[:, 0])):
        apart = xy[two] - xy[one]
        squared = (apart**2).sum(axis=1)
        ahead = (apart * inward[one]).sum(axis=1)
        far = squared > _OWN_WALL_M**2
        for radius, side in ((free, ahead), (rock, -ahead)):
            faces = far & (side > 1e-6)
            np.minimum.at(radius, one[faces], squared[faces] / (2 * side[faces]))
    return free, rock


def _passages(xy: np.ndarray, disc_m: np.ndarray, network: DriftNetwork) -> np.ndarray:
    """Return half the width (n,) m of the narrowest passage beside each column; where there is none, its disc."""
    stations, half = passage_stations(network)
    least = np.full(len(xy), np.inf)
    for beside, width in zip(cKDTree(xy).query_ball_point(stations, _BESIDE * half + _BESIDE_M), half, strict=True):
        least[beside] = np.minimum(least[beside], width)
    return np.where(np.isfinite(least), least, disc_m)


def _evened(radius: np.ndarray, rings: list[Ring]) -> np.ndarray:
    """Take the least of the neighbourhood along each wall, then smooth it within that neighbourhood."""
    even = np.empty_like(radius)
    for ring in rings:
        part = slice(ring.first, ring.first + ring.count)
        reach = min(int(_EVEN_M / ring.step_m), (ring.count - 1) // 2)
        least = minimum_filter1d(radius[part], 2 * reach + 1, mode="wrap")
        even[part] = gaussian_filter1d(least, max(reach / 3, 0.1), mode="wrap", truncate=3)
    return even
