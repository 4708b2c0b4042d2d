"""Charts: pieces of the rock that lie flat in a picture, each with a place of its own in it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

_FINEST_M = 0.01  # of a picture's pixel: points of a scan are farther apart
_MARGIN_PX = 2  # about a chart: a renderer mixes the pixels beside it in
_COARSER = 1.05  # in each try


@dataclass(frozen=True)
class Charts:
    """How the faces of a mesh lie in a picture that covers a square of `across_m`.

    `number` (m,) is the chart of each face, `way` (c,) the group of axes that a chart's coordinates have, and
    `shift_m` (c, 2) what moves these to their place.
    """

    number: np.ndarray
    way: np.ndarray
    shift_m: np.ndarray
    across_m: float

    def __len__(self) -> int:
        """Return the number of charts."""
        return len(self.way)


def repeated(group: np.ndarray, groups: int, repeat_m: float) -> Charts:
    """Return the charts of a picture that repeats every `repeat_m`: all faces of a group (m,) lie on each other."""
    return Charts(group, np.arange(groups), np.zeros((groups, 2)), repeat_m)


def charts_of(faces: np.ndarray, key: np.ndarray) -> np.ndarray:
    """Return the number (m,) of the connected piece of faces (m, 3) with equal keys (m, k) that each face is of."""
    count = len(faces)
    kind = np.unique(key, axis=0, return_inverse=True)[1].reshape(-1)
    ends = np.sort(np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)]).astype(np.int64), axis=1)
    edge = ends[:, 0] * (int(faces.max()) + 1) + ends[:, 1]
    order = np.argsort(edge, kind="stable")
    one, other = order[:-1] % count, order[1:] % count
    meet = (edge[order[:-1]] == edge[order[1:]]) & (kind[one] == kind[other])
    pairs = one[meet], other[meet]
    graph = coo_matrix((np.ones(int(meet.sum()), np.int8), pairs), (count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def packed(number: np.ndarray, group: np.ndarray, corners_m: np.ndarray, most_px: int) -> tuple[Charts, int]:
    """Return charts side by side in a square picture, and its side, px.

    Its pixels are 1 cm wide, or as wide as it takes to keep it within `most_px`.

    Parameters
    ----------
    number : (m,) int
        The chart of each face.
    group : (m,) int
        The group of axes of each face; one a chart.
    corners_m : (m, 3, 2) float64, m
        Coordinates of the corners.
    most_px : int
    """
    order = np.argsort(number, kind="stable")
    first = np.searchsorted(number[order], np.arange(number.max() + 1))
    low = np.minimum.reduceat(corners_m[order].min(axis=1), first)
    size = np.maximum.reduceat(corners_m[order].max(axis=1), first) - low
    area = float(size.prod(axis=1).sum())
    pixel_m = max(_FINEST_M, math.sqrt(area) / most_px)
    side = min(most_px, max(16, math.ceil(math.sqrt(area) / pixel_m)))
    while (places := _shelved(np.ceil(size / pixel_m).astype(np.int64) + 2 * _MARGIN_PX, side)) is None:
        if side < most_px:
            side = min(most_px, math.ceil(side * _COARSER))
        else:
            pixel_m *= _COARSER
    shift = (places + _MARGIN_PX) * pixel_m - low
    return Charts(number, group[order][first], shift, side * pixel_m), side


def _shelved(size: np.ndarray, side: int) -> np.ndarray | None:
    """Return where boxes (c, 2) px lie in a square, on shelves from the highest to the lowest; None if they do not."""
    places = np.zeros((len(size), 2), np.int64)
    x = y = shelf = 0
    for number in np.argsort(-size[:, 1], kind="stable").tolist():
        width, height = size[number].tolist()
        if x + width > side:
            x, y, shelf = 0, y + shelf, 0
        if width > side or y + height > side:
            return None
        places[number] = x, y
        x, shelf = x + width, max(shelf, height)
    return places
