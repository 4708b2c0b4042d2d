"""Heights along a drift network, from a grade or from spots: lines for `build_floor`."""

from __future__ import annotations

import numpy as np
import shapely
from scipy.interpolate import LinearNDInterpolator
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra
from shapely.geometry.base import BaseGeometry

from minesurveys.frames import Heights
from pipeline.errors import GeometryError
from pipeline.geometry.floor.mesh import build_floor
from pipeline.geometry.floor.solved_heights import solve_heights
from pipeline.geometry.polyline import arc_length
from pipeline.types import DriftNetwork, FloorMesh

_NEAR_M = 15.0  # of a spot from the middle of its drift
_SAME_M = 0.01
_ALIKE_M, _STEP_M = 0.5, 0.3  # spots so near to each other along a drift count by their mean, and differ by no more


def plan_floors(
    outline: BaseGeometry, heights: Heights, network: DriftNetwork, start_m: tuple[float, float] | None
) -> FloorMesh:
    """Return the floor of a plan's outline (m, mine frame), whose heights are known in its drifts.

    A grade begins at `start_m`, or where the main drift does.

    Raises
    ------
    GeometryError
        If a height is far from every drift, or contradicts another; the message names the place.
    """
    lines = floor_lines(heights, network, start_m or network.main_drift_m[0])
    return build_floor(outline, lines, heights.datum_m)


def floor_lines(heights: Heights, network: DriftNetwork, entrance_m: tuple[float, float]) -> list[np.ndarray]:
    """Return the lines (k, 3) m along which the floor's height is known.

    Spots set the height at the nearest place of a drift, a surface that at each station between its points. Between
    those it is linear along the drifts, and beyond the last one it stays. A grade rises from the station nearest to
    the entrance by the shortest way.

    Raises
    ------
    GeometryError
        If a spot is far from every drift, two spots at one place differ, or no drift lies on the surface; the message
        names the spot.
    """
    if heights.lines:
        return [np.array(line, dtype=float) for line in heights.lines]
    along = [] if heights.sampled or heights.grade is not None else _along_legs(network, heights)
    places, number, lengths, known = _graph(network, along)
    if heights.grade is not None:
        start = int(np.linalg.norm(places - entrance_m, axis=1).argmin())
        z = heights.grade * dijkstra(lengths, directed=False, indices=start)
    else:
        z = _harmonic(len(places), lengths, _on_surface(places, heights) if heights.sampled else known)
    return [np.column_stack([places[nodes], z[nodes]]) for nodes in number]


def _on_surface(places: np.ndarray, heights: Heights) -> dict[int, float]:
    """Return the height, m, at those of the places (n, 2) m that lie between points of a surface."""
    spots = np.array(heights.spots, dtype=float)
    z = LinearNDInterpolator(spots[:, :2], spots[:, 2])(places) if len(spots) > 2 else np.full(len(places), np.nan)
    known = np.flatnonzero(np.isfinite(z))
    if not len(known):
        raise GeometryError(f"heights: no drift lies between the {len(spots)} points of the floor's surface")
    return dict(zip(known.tolist(), z[known].tolist(), strict=True))


def _along_legs(network: DriftNetwork, heights: Heights) -> list[tuple[int, float, float]]:
    """Return the leg, the distance along it and the height, m, of each spot, by leg and distance.

    A spot counts at the nearest place of a leg. Spots at about one place count by their mean.
    """
    spots = np.array(heights.spots, dtype=float)
    lines = np.array([shapely.LineString(leg.stations_m) for leg in network.legs])
    points = shapely.points(spots[:, :2])
    leg, apart = shapely.STRtree(lines).query_nearest(points, return_distance=True, all_matches=False)
    leg = leg[1]
    if apart.max() > _NEAR_M:
        far = int(apart.argmax())
        x, y, z = spots[far]
        raise GeometryError(
            f"heights: the spot ({x:.1f}, {y:.1f}), {z:.2f} m high, is {apart[far]:.1f} m from the nearest drift, the "
            f"limit is {_NEAR_M:g} m"
        )
    along = shapely.line_locate_point(lines[leg], points)
    found: list[tuple[int, float, float]] = []
    group: list[int] = []
    order = np.lexsort((along, leg)).tolist()
    for k, after in zip(order, [*order[1:], None], strict=True):
        group.append(k)
        if after is not None and leg[after] == leg[k] and along[after] - along[group[0]] <= _ALIKE_M:
            continue
        low, high = (group[f(spots[group, 2])] for f in (np.argmin, np.argmax))
        if spots[high, 2] - spots[low, 2] > _STEP_M:
            (x, y, z), other = spots[high], spots[low, 2]
            raise GeometryError(
                f"heights: the spot ({x:.1f}, {y:.1f}) is {z:.2f} m high, another at the same place {other:.2f} m"
            )
        found.append((int(leg[k]), float(along[group].mean()), float(spots[group, 2].mean())))
        group = []
    return found


def _graph(
    network: DriftNetwork, pinned: list[tuple[int, float, float]]
) -> tuple[np.ndarray, list[np.ndarray], csr_matrix, dict[int, float]]:
    """Return the stations (n, 2) m, the numbers of each leg's stations, the distances between neighbours, and heights.

    Places along legs whose heights are known become stations, too, unless one is there.
    """
    rows: list[np.ndarray] = []
    places: list[tuple[float, float]] = []
    number: dict[str, int] = {}
    known: dict[int, float] = {}

    def number_of(name: str, place: tuple[float, float]) -> int:
        if name not in number:
            number[name] = len(places)
            places.append(place)
        return number[name]

    for k, leg in enumerate(network.legs):
        names = [leg.start, *(f"{leg.name} {i}" for i in range(1, len(leg.stations_m) - 1)), leg.end]
        line = np.array(leg.stations_m)
        distance = arc_length(line)
        nodes = [number_of(name, place) for name, place in zip(names, leg.stations_m, strict=True)]
        stations = list(zip(distance.tolist(), nodes, strict=True))
        for at, (_, along, z) in enumerate(row for row in pinned if row[0] == k):
            apart, node = min((abs(d - along), node) for d, node in stations)
            if apart > _SAME_M:
                x, y = (float(np.interp(along, distance, line[:, axis])) for axis in (0, 1))
                node = number_of(f"{leg.name} spot {at}", (x, y))
                stations.append((along, node))
            known[node] = z
        rows.append(np.array([node for _, node in sorted(stations)]))
    xy = np.array(places)
    pairs = np.concatenate([np.column_stack([row[:-1], row[1:]]) for row in rows])
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
    apart_m = np.maximum(np.linalg.norm(xy[pairs[:, 0]] - xy[pairs[:, 1]], axis=1), 1e-6)
    return xy, rows, coo_matrix((apart_m, pairs.T), (len(xy), len(xy))).tocsr(), known


def _harmonic(stations: int, lengths: csr_matrix, known: dict[int, float]) -> np.ndarray:
    """Return heights (n,) m that are linear along the drifts between the stations whose heights are known."""
    joined = lengths + lengths.T
    weight = joined.copy()
    weight.data = 1.0 / joined.data
    stiff = (coo_matrix((np.asarray(weight.sum(axis=1)).ravel(), (range(stations),) * 2)) - weight).tocsr()
    z = np.zeros(stations)
    pinned = np.array(list(known))
    z[pinned] = list(known.values())
    free = np.setdiff1d(np.arange(stations), pinned)
    if len(free):
        z[free] = solve_heights(stiff[free][:, free].tocsc(), -stiff[free][:, pinned] @ z[pinned])
    return z
