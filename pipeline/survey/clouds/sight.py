"""What a scanner saw: free voxels on its rays to walls, and the place that each point was seen from."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from pipeline.survey.clouds.facing import SIGHT_M
from pipeline.survey.clouds.flood import Walls
from pipeline.survey.clouds.voxels import STEPS, cells_at, grown, is_in, keys_of, offsets_of

_RAYS = 1000  # from each place, 6 degrees apart; those of the next place lie between them
_APART_M = 1.0  # between places of a trajectory that rays begin at
_PLACES = 32  # at once, so that memory does not grow with the trajectory
_TRIED = 8  # places nearest to a point, of which the first that sees it is taken
_FRONT = 0.2  # cosine of the angle between a ray back to the scanner and the wall's normal, at least
_BEFORE = 3.0  # voxels before a point, where its own wall may be: walls are thickened by one
_GOLDEN = np.pi * (3 - np.sqrt(5))


def seen_from(places_m: np.ndarray, walls: Walls) -> np.ndarray:
    """Return the voxels (sorted numbers) that rays from places (n, 3) m pass on their way to a wall within sight.

    Rays that end nowhere show no free space. Holes between rays, up to two voxels wide, are filled.
    """
    _, first = np.unique(keys_of(cells_at(places_m, _APART_M)), return_index=True)
    places = places_m[np.sort(first)]
    places = places[~is_in(keys_of(cells_at(places, walls.size_m)), walls.thick)]
    seen = np.zeros(0, np.int64)
    for k in range(0, len(places), _PLACES):
        seen = np.union1d(seen, _passed(places[k : k + _PLACES], k, walls))
    return _closed(seen, walls.thick)


def _rays(turn: int) -> np.ndarray:
    """Return directions (n, 3) spread evenly over a sphere, turned about the vertical for each place."""
    height = 1 - (2 * np.arange(_RAYS) + 1) / _RAYS
    angle = _GOLDEN * np.arange(_RAYS) + turn
    wide = np.sqrt(1 - height**2)
    return np.column_stack([wide * np.cos(angle), wide * np.sin(angle), height])


def _passed(places: np.ndarray, number: int, walls: Walls) -> np.ndarray:
    way = np.concatenate([_rays(number + k) for k in range(len(places))]) * walls.size_m
    place, ray = np.repeat(places, _RAYS, axis=0), np.arange(len(way))
    hit = np.zeros(len(way), bool)
    passed = [(ray, keys_of(cells_at(place, walls.size_m)))]
    for step in range(1, int(SIGHT_M / walls.size_m)):  # walls are three voxels thick: no step of one jumps over them
        keys = keys_of(cells_at(place[ray] + step * way[ray], walls.size_m))
        ends = is_in(keys, walls.thick)
        hit[ray[ends]] = True
        ray = ray[~ends]
        passed.append((ray, keys[~ends]))
    return np.unique(np.concatenate([keys[hit[rays]] for rays, keys in passed]))


def _closed(seen: np.ndarray, walls: np.ndarray) -> np.ndarray:
    """Return a set with the voxels about which all 26 are in walls, in the set, or beside it."""
    wide = grown(seen)
    inner = wide[~is_in(wide, walls)]
    filled = np.ones(len(inner), bool)
    for offset in offsets_of(STEPS):
        filled &= is_in(inner + offset, wide) | is_in(inner + offset, walls)
    return np.union1d(seen, inner[filled])


def nearest_in_sight(points_m: np.ndarray, normals: np.ndarray, places_m: np.ndarray, walls: Walls) -> np.ndarray:
    """Return for each point the nearest place that sees it, (n, 3) m, NaN where none of the eight nearest does.

    Parameters
    ----------
    points_m, normals : (n, 3) float64
        Normals show into the free space.
    places_m : (k, 3) float64, m
    walls : Walls
        No ray passes their thickened voxels, except those beside the point.
    """
    found = np.full(points_m.shape, np.nan)
    tree = cKDTree(places_m)
    far, near = tree.query(points_m, np.arange(1, min(_TRIED, tree.n) + 1), distance_upper_bound=SIGHT_M)
    for own_m, own in zip(far.T, near.T, strict=True):
        rows = np.flatnonzero(np.isnan(found[:, 0]) & np.isfinite(own_m))
        way = points_m[rows] - places_m[own[rows]]
        front = -np.einsum("ij,ij->i", way, normals[rows]) > _FRONT * own_m[rows]
        rows, way = rows[front], way[front]
        rows = rows[_is_clear(places_m[own[rows]], way, own_m[rows], walls)]
        found[rows] = places_m[own[rows]]
    return found


def _is_clear(places: np.ndarray, way: np.ndarray, far_m: np.ndarray, walls: Walls) -> np.ndarray:
    """Return along which ways (n, 3) of a length (n,) m from places (n, 3) m no wall stands before the last voxels."""
    clear, steps = np.ones(len(places), bool), far_m / walls.size_m - _BEFORE
    for step in range(int(max(steps.max(initial=0), 0)) + 1):
        rows = np.flatnonzero(clear & (step <= np.maximum(steps, 0)))
        at = places[rows] + way[rows] * (step * walls.size_m / far_m[rows])[:, None]
        clear[rows] = ~is_in(keys_of(cells_at(at, walls.size_m)), walls.thick)
    return clear
