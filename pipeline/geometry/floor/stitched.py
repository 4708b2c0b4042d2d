"""Triangle meshes of floors that meet, stitched along their common edges into one mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree


@dataclass(frozen=True)
class FloorPart:
    """A piece of floor: vertices (n, 3) m, and faces (f, 3) that are counter-clockwise seen from above."""

    vertices: np.ndarray
    faces: np.ndarray


@dataclass(frozen=True)
class StitchedFloors:
    """One mesh: vertices (n, 3) m, faces (f, 3), the part (f,) of each face, and the pairs (k, 2) of parts joined."""

    vertices: np.ndarray
    faces: np.ndarray
    part: np.ndarray
    joined: np.ndarray


def stitch(parts: Sequence[FloorPart], apart_m: float, step_m: float) -> StitchedFloors:
    """Join parts along edges whose ends are no further apart than `apart_m` in plan and `step_m` in height.

    A common corner has the place that it has in the first of its parts. Parts that meet in a corner alone are not
    joined there, so that each edge has two faces at most and each corner one fan of faces.
    """
    sizes = np.cumsum([0, *(len(part.vertices) for part in parts)])
    places = np.concatenate([part.vertices for part in parts])
    faces = np.concatenate([part.faces + start for part, start in zip(parts, sizes[:-1], strict=True)])
    part = np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts])
    owner = np.repeat(np.arange(len(parts)), np.diff(sizes))
    spot = _spots(places, owner, apart_m, step_m)[faces]
    whole = (spot != np.roll(spot, 1, axis=1)).all(axis=1)
    faces, part, spot = faces[whole], part[whole], spot[whole]
    one, two = _mates(spot)
    start, end = np.arange(3 * len(faces)), _next(np.arange(3 * len(faces)))
    a, b = np.concatenate([start[one], end[one]]), np.concatenate([end[two], start[two]])
    _, group = connected_components(coo_matrix((np.ones(len(a)), (a, b)), (len(start),) * 2), directed=False)
    order = np.lexsort((np.repeat(part, 3), group))
    first = order[np.unique(group[order], return_index=True)[1]]
    pairs = np.sort(np.column_stack([part[one // 3], part[two // 3]]), axis=1)
    return StitchedFloors(
        places[faces.ravel()[first]],
        group.reshape(-1, 3),
        part,
        np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0),
    )


def _spots(places: np.ndarray, owner: np.ndarray, apart_m: float, step_m: float) -> np.ndarray:
    """Return for each vertex the number of its place, which vertices of other parts share."""
    pairs = cKDTree(places[:, :2]).query_pairs(apart_m, output_type="ndarray")
    level = np.abs(places[pairs[:, 0], 2] - places[pairs[:, 1], 2]) <= step_m
    a, b = pairs[level & (owner[pairs[:, 0]] != owner[pairs[:, 1]])].T
    n = len(places)
    found: np.ndarray = connected_components(coo_matrix((np.ones(len(a)), (a, b)), (n, n)), directed=False)[1]
    return found


def _next(corner: np.ndarray) -> np.ndarray:
    """Return the number of the corner that follows each in its face."""
    return corner - corner % 3 + (corner + 1) % 3


def _mates(spot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the edges (k,) of faces (f, 3) that two faces share, and the same edges of the other faces.

    Edge 3 f + k begins at corner k of face f. An edge of more than two faces joins none.
    """
    begin, finish = spot.ravel(), np.roll(spot, -1, axis=1).ravel()
    count = int(spot.max(initial=0)) + 1
    key, back = begin * count + finish, finish * count + begin
    order = np.argsort(key, kind="stable")
    at = np.searchsorted(key[order], back)
    at = np.minimum(at, len(key) - 1)
    _, number, times = np.unique(key, return_inverse=True, return_counts=True)
    single = times[number] == 1
    mate = order[at]
    shared = (key[mate] == back) & single & single[mate] & (begin < finish)
    return np.flatnonzero(shared), mate[shared]
