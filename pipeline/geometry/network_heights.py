"""Heights along a drift network, from a grade or from spots: lines for `floor_mesh`."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from pipeline.errors import GeometryError
from pipeline.types import DriftNetwork, Heights

_NEAR_M = 15.0  # of a spot from the middle of its drift
_SAME_M = 0.01


def floor_lines(
    heights: Heights, network: DriftNetwork, entrance_m: tuple[float, float], height_m: float = 0.0
) -> list[np.ndarray]:
    """Return the lines (k, 3) m along which the floor's height is known; (k, 4) m with the roof over it if that is too.

    Spots set the height of the station nearest to them; between them it is linear along the drifts, and beyond the
    last one it stays. A grade rises from the station nearest to the entrance by the shortest way. The roof is
    `height_m` over the floor where the survey knows none.

    Raises
    ------
    GeometryError
        If a spot is far from every drift, or two spots of one station differ; the message names the spot.
    """
    if heights.roofs:
        pairs = zip(heights.lines, heights.roofs, strict=True)
        return [np.column_stack([line, np.array(roof) @ [1.0, height_m]]) for line, roof in pairs]
    if heights.lines:
        return [np.array(line, dtype=float) for line in heights.lines]
    places, number, lengths = _graph(network)
    if heights.grade is not None:
        start = int(np.linalg.norm(places - entrance_m, axis=1).argmin())
        z = heights.grade * dijkstra(lengths, directed=False, indices=start)
    else:
        z = _between(places, lengths, np.array(heights.spots, dtype=float))
    return [np.column_stack([places[nodes], z[nodes]]) for nodes in number]


def _graph(network: DriftNetwork) -> tuple[np.ndarray, list[np.ndarray], csr_matrix]:
    """Return the stations (n, 2) m, the numbers of each leg's stations, and the distances between neighbours."""
    rows: list[np.ndarray] = []
    places: list[tuple[float, float]] = []
    number: dict[str, int] = {}
    for leg in network.legs:
        names = [leg.start, *(f"{leg.name} {k}" for k in range(1, len(leg.stations_m) - 1)), leg.end]
        for name, place in zip(names, leg.stations_m, strict=True):
            if name not in number:
                number[name] = len(places)
                places.append(place)
        rows.append(np.array([number[name] for name in names]))
    xy = np.array(places)
    pairs = np.concatenate([np.column_stack([row[:-1], row[1:]]) for row in rows])
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
    apart = np.maximum(np.linalg.norm(xy[pairs[:, 0]] - xy[pairs[:, 1]], axis=1), 1e-6)
    return xy, rows, coo_matrix((apart, pairs.T), (len(xy), len(xy))).tocsr()


def _between(places: np.ndarray, lengths: csr_matrix, spots: np.ndarray) -> np.ndarray:
    apart, nearest = cKDTree(places).query(spots[:, :2])
    far = int(apart.argmax())
    if apart[far] > _NEAR_M:
        x, y, z = spots[far]
        raise GeometryError(
            f"heights: the spot ({x:.1f}, {y:.1f}), {z:.2f} m high, is {apart[far]:.1f} m from the nearest drift, the "
            f"limit is {_NEAR_M:g} m"
        )
    known: dict[int, float] = {}
    for node, (x, y, z) in zip(nearest.tolist(), spots.tolist(), strict=True):
        if abs(known.setdefault(node, z) - z) > _SAME_M:
            raise GeometryError(
                f"heights: the spot ({x:.1f}, {y:.1f}) is {z:.2f} m high, another at the same place {known[node]:.2f} m"
            )
    joined = lengths + lengths.T
    weight = joined.copy()
    weight.data = 1.0 / joined.data
    stiff = (coo_matrix((np.asarray(weight.sum(axis=1)).ravel(), (range(len(places)),) * 2)) - weight).tocsr()
    z = np.zeros(len(places))
    pinned = np.array(list(known))
    z[pinned] = list(known.values())
    free = np.setdiff1d(np.arange(len(places)), pinned)
    if len(free):
        z[free] = spsolve(stiff[free][:, free].tocsc(), -stiff[free][:, pinned] @ z[pinned])
    return z
