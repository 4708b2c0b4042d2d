"""Whether a volume lets one pass along each leg of its survey, from station to station."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from minexplore.floors.volume_arrays import each_of
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.union import Volume

_GATES, _MIDDLES = (0.25, 0.5, 0.75), (1 / 6, 1 / 2, 5 / 6)  # of a section's width and height
_TOUCH_M = 0.01  # before a gate, and before a station: those of a dead end are on its wall
_LEAST_M = 0.05  # half of a level section
_FROM_WALL_M, _FROM_FLOOR_M = 0.05, 0.1  # of gates beside a station: it may be on a wall or on the floor
_AT_ONCE = 1000  # pairs of ends: 360,000 lines
_FEW = 0.25  # of a leg: it is asked again, step by step
_STEP_M, _ROWS = 0.25, 7  # along such a leg, and places across and up
_UP = np.array([0.0, 0.0, 1.0])


def open_figures(network: SurveyNetwork, offset_m: np.ndarray, volume: Volume) -> dict[str, Any]:
    """Return the least of `open_shares`, and the leg that has it."""
    share = open_shares(network, offset_m, volume)
    least = int(share.argmin())
    return {"open_share": round(float(share[least]), 4), "open_at": f"leg {network.leg_name(least)}"}


def open_shares(network: SurveyNetwork, offset_m: np.ndarray, volume: Volume) -> np.ndarray:
    """Return which share (m,) of each leg's section half-way is joined to both of its stations.

    A section at the end of a leg has gates, spread over it and about the station. A place half-way along a leg is
    joined to the gates that it sees of all legs at one of its stations, and so to all that these are joined to. What is
    joined to most gates of a station is the station's. So a leg with a share is open: straight lines in the free space
    lead from station to station by way of it. A wall through all of a leg, wherever and however it stands, leaves none,
    also where another way leads round it. The section half-way has nine places, upright or level: the one with the
    larger share counts, as a shaft has level sections. A leg that has few is asked again step by step (`_by_steps`):
    rock in a long crawl may leave a way, and no straight line along it.

    The network is moved by `offset_m` (3,) m into the frame of the volume.
    """
    gates, middles = _gates(network) + offset_m, _middles(network) + offset_m
    station, (ends, count), k = network.shots.reshape(-1), gates.shape[:2], middles.shape[1]
    order = np.argsort(station, kind="stable")
    first, last = (np.searchsorted(station[order], station, side) for side in ("left", "right"))
    end, number = each_of(last - first)
    beside = order[first[end] + number]  # ends at one station: those from whose legs gates of these are looked at
    free = volume.inside.rays_say_free(middles.reshape(-1, 3)).reshape(len(middles), k)
    seen = [
        _see(volume, middles[end[some] // 2], gates[beside[some]]) & free[end[some] // 2][:, :, None]
        for some in (slice(n, n + _AT_ONCE) for n in range(0, len(end), _AT_ONCE))
    ]
    pair, place, gate = np.nonzero(np.concatenate(seen))
    nodes = ends * (count + k)
    lines = beside[pair] * count + gate, ends * count + end[pair] * k + place
    label = connected_components(coo_matrix((np.ones(len(pair)), lines), (nodes, nodes)), directed=False)[1]
    codes, gates_of = np.unique(np.repeat(station, count) * nodes + label[: ends * count], return_counts=True)
    codes = codes[np.lexsort((gates_of, codes // nodes))]
    own = np.zeros(len(network.places_m), np.int64)
    own[codes // nodes] = codes % nodes  # of each station the last stays, with most gates
    joined = label[ends * count :].reshape(ends, k) == own[station][:, None]
    share: np.ndarray = joined.reshape(-1, 2, k).all(axis=1).reshape(len(middles), 2, -1).mean(axis=2).max(axis=1)
    is_own = label[: ends * count].reshape(ends, count) == own[station][:, None]
    for leg in np.flatnonzero(share < _FEW).tolist():
        at_ends = [gates[end][is_own[end]] for end in (2 * leg, 2 * leg + 1)]
        share[leg] = max(share[leg], _by_steps(network, leg, offset_m, volume, at_ends))
    return share


def _by_steps(
    network: SurveyNetwork, leg: int, offset_m: np.ndarray, volume: Volume, at_ends: list[np.ndarray]
) -> float:
    """Return which share of the places half-way along a leg steps in its free space join to gates at both of its ends.

    Places lie in sections a quarter of a metre apart, seven across and seven up. A step is a straight line from a place
    to one beside it, in its section or the next, and at an end to a gate.
    """
    length_m = float(network.lengths_m[leg])
    count, end = 2 * int(length_m / _STEP_M / 2) + 3, min(_TOUCH_M / length_m, 0.25)
    along = np.linspace(end, 1 - end, count)[:, None]
    lrud, across, floors = (
        (1 - along) * rows[leg, 0] + along * rows[leg, 1]
        for rows in (network.lrud_m, network.across, network.floors_m + offset_m)
    )
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    shares = tuple((np.arange(_ROWS) + 0.5) / _ROWS)
    places = _spread(floors, across, _between(-lrud[:, 1], lrud[:, 0], shares), _upright(lrud, shares)).reshape(-1, 3)
    number = np.arange(len(places)).reshape(count, _ROWS, _ROWS)
    beside = [(k, i, j) for k in (0, 1) for i in (-1, 0, 1) for j in (-1, 0, 1) if (k, i, j) > (0, 0, 0)]
    section, row, level = np.indices(number.shape).reshape(3, -1)
    pairs = []
    for k, i, j in beside:
        near = section + k, row + i, level + j
        is_there = (near[0] < count) & (np.stack(near[1:]) >= 0).all(axis=0) & (np.stack(near[1:]) < _ROWS).all(axis=0)
        pairs.append(np.column_stack([number.ravel()[is_there], number[tuple(rows[is_there] for rows in near)]]))
    free = volume.inside.rays_say_free(places)
    steps = np.concatenate(pairs)
    one, other = steps[free[steps].all(axis=1)].T
    way = places[other] - places[one]
    length = np.linalg.norm(way, axis=1)
    is_step = volume.inside.ways_m(places[one], way / np.maximum(length, 1e-9)[:, None]) >= length
    one, other = one[is_step], other[is_step]
    label = connected_components(coo_matrix((np.ones(len(one)), (one, other)), (len(places),) * 2), directed=False)[1]
    ends = [
        label[rows[free[rows] & _see(volume, places[rows][None], gates[None])[0].any(axis=1)]]
        for rows, gates in zip((number[0].ravel(), number[-1].ravel()), at_ends, strict=True)
    ]
    middle = number[count // 2].ravel()
    return float((free[middle] & np.isin(label[middle], np.intersect1d(*ends))).mean())


def _see(volume: Volume, places: np.ndarray, gates: np.ndarray) -> np.ndarray:
    """Return which of places (n, k, 3) m see which of gates (n, g, 3) m, as (n, k, g)."""
    way = gates[:, None] - places[:, :, None]
    length = np.linalg.norm(way, axis=3)
    starts = np.broadcast_to(places[:, :, None], way.shape).reshape(-1, 3)
    free_m = volume.inside.ways_m(starts, (way / np.maximum(length, _TOUCH_M)[:, :, :, None]).reshape(-1, 3))
    found: np.ndarray = free_m.reshape(length.shape) >= length - _TOUCH_M
    return found


def _gates(network: SurveyNetwork) -> np.ndarray:
    """Return the gates (2 m, 20, 3) m of both ends of each leg: a grid over its section, and through the station."""
    lrud, across = network.lrud_m.reshape(-1, 4), network.across.reshape(-1, 2)
    from_wall = np.minimum(_FROM_WALL_M, lrud[:, :2].sum(axis=1) / 2)
    from_floor = np.minimum(_FROM_FLOOR_M, lrud[:, 2:].sum(axis=1) / 2)
    at_station = np.zeros(len(lrud)), np.clip(0, from_wall - lrud[:, 1], lrud[:, 0] - from_wall)
    aside = np.column_stack([_between(-lrud[:, 1], lrud[:, 0], _GATES), *at_station])
    height = np.clip(lrud[:, 3], from_floor, lrud[:, 2:].sum(axis=1) - from_floor)
    up = np.concatenate([_upright(lrud, _GATES), height[:, None, None] * _UP], axis=1)
    return _spread(network.floors_m.reshape(-1, 3), across, aside, up)


def _middles(network: SurveyNetwork) -> np.ndarray:
    """Return the places (m, 18, 3) m half-way along each leg: nine of an upright section, and nine of a level one."""
    lrud, across, floors = (rows.mean(axis=1) for rows in (network.lrud_m, network.across, network.floors_m))
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    half = np.maximum(lrud[:, :2].sum(axis=1) / 2, _LEAST_M)
    ahead = np.column_stack([across[:, 1], -across[:, 0], np.zeros(len(across))])
    level = _between(-half, half, _MIDDLES)[:, :, None] * ahead[:, None]
    aside = _between(-lrud[:, 1], lrud[:, 0], _MIDDLES)
    both = [_spread(floors, across, aside, more) for more in (_upright(lrud, _MIDDLES), level)]
    return np.concatenate(both, axis=1)


def _between(low: np.ndarray, high: np.ndarray, shares: tuple[float, ...]) -> np.ndarray:
    """Return places (n, k) at shares (k,) of the way from low (n,) to high (n,)."""
    found: np.ndarray = low[:, None] + np.array(shares) * (high - low)[:, None]
    return found


def _upright(lrud: np.ndarray, shares: tuple[float, ...]) -> np.ndarray:
    """Return ways (n, k, 3) m up from floors, at shares of the height of sections (n, 4) m."""
    tall = lrud[:, 2:].sum(axis=1)
    found: np.ndarray = _between(np.zeros(len(tall)), tall, shares)[:, :, None] * _UP
    return found


def _spread(floors: np.ndarray, across: np.ndarray, aside: np.ndarray, more: np.ndarray) -> np.ndarray:
    """Return places (n, a * b, 3) m: floors (n, 3) moved by `aside` (n, a) m across them, and by each of `more`."""
    left = np.column_stack([across, np.zeros(len(across))])
    places = floors[:, None] + aside[:, :, None] * left[:, None]
    found: np.ndarray = (places[:, :, None] + more[:, None]).reshape(places.shape[0], -1, 3)
    return found
