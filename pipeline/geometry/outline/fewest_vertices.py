"""The polygon with the fewest vertices within a mean distance of a traced outline."""

from __future__ import annotations

import numpy as np
import shapely
from shapely import Polygon

from pipeline.errors import GeometryError
from pipeline.geometry.outline.edge_fit import edge_distances, fit_vertices, largest_distances
from pipeline.geometry.polyline import line_moments
from pipeline.geometry.wall_distance import distances_to_walls, points_on_walls
from pipeline.types import Points2

_FINER = 3.0  # candidates for vertices lie within the error divided by this
_LONGEST = 80  # candidates that one edge may pass
MOST_RATIO = 8.0  # of the largest error to the mean one; 7 where nothing bounds it (docs/adr/0012)
_P99_RATIO = 5.3  # of 99 % of the errors to the mean one; rough walls have 4.6, a room with furniture had 6.3
_PENALTIES = (0.1, 100.0)  # times the squared error, m3; rough drifts need 5 to 15
_BISECTIONS = 9
_TRIES = 6  # smaller penalties, each a tenth of the last, where the range holds none
_LAST_PENALTY = 1e-9
_REPAIRS = 12


class _Ring:
    """A traced ring, the candidates for vertices on it, and the squared error of every edge between them."""

    def __init__(self, ring: Points2, error_m: float) -> None:
        open_ring = ring[:-1]
        first = int(np.linalg.norm(open_ring - open_ring.mean(axis=0), axis=1).argmax())  # a corner, so a vertex
        self.traced = np.vstack([np.roll(open_ring, -first, axis=0), open_ring[first]])
        line = shapely.simplify(shapely.LineString(self.traced), error_m / _FINER, preserve_topology=False)
        place = {xy.tobytes(): i for i, xy in enumerate(self.traced[:-1])}
        kept = [place[xy.tobytes()] for xy in shapely.get_coordinates(line)[:-1]]
        self.at = np.array([*kept, len(self.traced) - 1])
        self.cost = _edge_costs(self.traced, self.at)
        self._last: tuple[bytes, float, tuple[Points2, np.ndarray]] = b"", 0.0, (self.traced, self.traced[:, 0])

    def fit(self, penalty: float, most_m: float) -> tuple[Points2, np.ndarray]:
        """Return the closed ring (k, 2) of least squared error plus penalty per vertex, and the distances (n,) m."""
        for _ in range(_REPAIRS):
            chosen = _cheapest_path(self.cost, penalty)
            while len(chosen) < 5 and penalty > _LAST_PENALTY:  # a ring needs a few edges
                penalty /= 4
                chosen = _cheapest_path(self.cost, penalty)
            worst = largest_distances(self.traced, self.at[chosen], self.traced[self.at[chosen]])
            far = np.flatnonzero((worst > most_m) & (np.diff(chosen) > 1))
            if not len(far):
                break
            self.cost[chosen[far + 1], chosen[far + 1] - chosen[far] - 1] = np.inf
        key = chosen.tobytes(), most_m
        if self._last[:2] != key:  # a small pillar keeps its vertices at most penalties
            ring = fit_vertices(self.traced, self.at[chosen], most_m)
            self._last = *key, (ring, edge_distances(self.traced, self.at[chosen], ring)[0])
        return self._last[2]


def simplify_to_error(outline: Polygon, error_m: float) -> Polygon:
    """Return the polygon with about the fewest vertices whose mean distance from the outline is at most `error_m`.

    Vertices are chosen among those of the outline so that the sum of squared distances and a penalty for each vertex is
    least. They are then moved to the places of least squared distance. The penalty is bisected until the mean distance
    of the outline from the polygon reaches `error_m`. No point of the outline lies farther away than eight times this,
    and 99 % of it within 5.3 times.
    Where walls lie so near each other that no such polygon is valid, the outline is simplified by Douglas-Peucker with
    its topology kept, and no point of it lies farther away than `error_m`.

    Parameters
    ----------
    outline : shapely.Polygon, m
    error_m : float
        Mean distance, m.

    Returns
    -------
    shapely.Polygon, m
        Valid, with as many holes as `outline`.

    Raises
    ------
    GeometryError
        If the outline itself is not valid; the message names the value.

    References
    ----------
    Perez & Vidal 1994, doi:10.1016/0167-8655(94)90002-7 (optimal polygonal approximation by dynamic programming);
    Imai & Iri 1988, doi:10.1016/B978-0-444-70467-2.50011-4.
    """
    rings = [_Ring(np.asarray(ring.coords)[:, :2], error_m) for ring in (outline.exterior, *outline.interiors)]
    for ratio in (MOST_RATIO, _P99_RATIO):  # the second bounds all points, and so 99 % of them
        best = _fewest(rings, error_m, ratio)
        if best is None:
            break
        if _p99_m(outline, best) <= _P99_RATIO * error_m:
            return best
    return _topology_kept(outline, error_m)


def _fewest(rings: list[_Ring], error_m: float, ratio: float) -> Polygon | None:
    """Return the valid polygon of the largest penalty within the mean error and `ratio` times it, if there is any."""
    low, high = np.log(np.array(_PENALTIES) * error_m**2)
    best = None
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        simple = _fit_all(rings, float(np.exp(middle)), error_m, ratio)
        low, high = (low, middle) if simple is None else (middle, high)
        best = simple or best
    for k in range(_TRIES):
        best = best or _fit_all(rings, float(np.exp(low)) / 10**k, error_m, ratio)
    return best


def _p99_m(outline: Polygon, simple: Polygon) -> float:
    """Return the distance, m, within which 99 % of the outline lies from the simplified one."""
    return float(np.percentile(distances_to_walls(simple, points_on_walls(outline)), 99))


def _topology_kept(outline: Polygon, error_m: float) -> Polygon:
    """Return the outline without vertices that lie within an error of it; none of its rings touches another."""
    simple = shapely.simplify(outline, error_m, preserve_topology=True)
    whole = isinstance(simple, Polygon) and simple.is_valid and len(simple.interiors) == len(outline.interiors)
    kept = simple if whole else outline
    if not kept.is_valid:
        raise GeometryError(
            f"contours.wall_error_m = {error_m:g}: the outline touches or crosses itself: "
            f"{shapely.is_valid_reason(kept)[:80]}"
        )
    return Polygon(kept)


def _fit_all(rings: list[_Ring], penalty: float, error_m: float, ratio: float) -> Polygon | None:
    """Return the polygon of a penalty if it is valid and within the errors."""
    fitted = [ring.fit(penalty, ratio * error_m) for ring in rings]
    off = np.concatenate([distance for _, distance in fitted])
    weight = np.concatenate([np.repeat(_lengths(ring.traced), 2) for ring in rings])
    simple = Polygon(fitted[0][0], [ring for ring, _ in fitted[1:]])
    holds = simple.is_valid and weight @ off <= error_m * weight.sum() and off.max() <= ratio * error_m
    return simple if holds else None


def _lengths(ring: Points2) -> np.ndarray:
    return np.linalg.norm(np.diff(ring, axis=0), axis=1)


def _edge_costs(traced: Points2, at: np.ndarray) -> np.ndarray:
    """Return [j, k]: the integral of squared distance, m3, of the trace from the edge of candidates j-1-k and j."""
    local = traced - traced.mean(axis=0)
    total = np.vstack([np.zeros(6), np.cumsum(line_moments(local), axis=0)])[at]
    places = local[at]
    cost = np.full((len(at), min(_LONGEST, len(at) - 1)), np.inf)
    for k in range(cost.shape[1]):
        after, before = np.s_[k + 1 :], np.s_[: len(at) - 1 - k]
        length, x, y, xx, xy, yy = (total[after] - total[before]).T
        along = places[after] - places[before]
        nx, ny = np.array([-along[:, 1], along[:, 0]]) / np.maximum(np.linalg.norm(along, axis=1), 1e-9)
        level = nx * places[before, 0] + ny * places[before, 1]
        squared = nx * nx * xx + 2 * nx * ny * xy + ny * ny * yy - 2 * level * (nx * x + ny * y) + level**2 * length
        cost[after, k] = np.maximum(squared, 0.0)
    return cost


def _cheapest_path(cost: np.ndarray, penalty: float) -> np.ndarray:
    """Return the candidates on the cheapest path from the first to the last, by dynamic programming."""
    total, previous = np.zeros(len(cost)), np.zeros(len(cost), dtype=int)
    for j in range(1, len(cost)):
        reach = min(cost.shape[1], j)
        sums = cost[j, :reach] + total[j - reach : j][::-1]
        k = int(sums.argmin())
        total[j], previous[j] = sums[k] + penalty, j - 1 - k
    path = [len(cost) - 1]
    while path[-1]:
        path.append(int(previous[path[-1]]))
    return np.array(path[::-1])
