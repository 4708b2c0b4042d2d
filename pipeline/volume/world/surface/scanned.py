"""How much of the visible rock is a scan's, by place, and the colours of the scan there."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

NO_SCAN, NO_RGB = np.zeros((0, 3)), np.zeros((0, 3), np.uint8)
_SEEN_M = (0.3, 0.9)  # from the next point of a scan: up to here the rock is the scan's, from here on synthetic
_NEIGHBOURS = 4  # whose colours are mixed
_LEAST_M = 0.01  # nearer neighbours have no more weight


def unseen(places: np.ndarray, scan_m: np.ndarray) -> np.ndarray:
    """Return the share (n,) of synthetic rock at places (n, 3) m: it grows from 0 to 1 away from a scan's points."""
    if not len(scan_m):
        return np.ones(len(places))
    apart, _ = cKDTree(scan_m).query(places, distance_upper_bound=_SEEN_M[1])
    return _synthetic(apart)


def _synthetic(apart_m: np.ndarray) -> np.ndarray:
    near, far = _SEEN_M
    return np.asarray(np.clip((apart_m - near) / (far - near), 0.0, 1.0))


class ScanColours:
    """The points of a scan that have colours."""

    def __init__(self, points_m: np.ndarray, rgb: np.ndarray) -> None:
        """Take the points (n, 3) m and their colours (n, 3) uint8: red, green, blue, black of a point without one.

        A scan without colours has none, (0, 3).
        """
        has_colour = rgb.any(axis=1)
        self._rgb = rgb[has_colour]
        self._tree = cKDTree(points_m[: len(rgb)][has_colour])

    def __len__(self) -> int:
        """Return the number of points that have a colour."""
        return len(self._rgb)

    def at(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the colours (n, 3) at places (n, 3) m, and the share (n,) of synthetic rock there.

        The colour is that of the nearest points, and that of the mean of all where the rock is synthetic.
        """
        apart, row = self._tree.query(places, _NEIGHBOURS, distance_upper_bound=_SEEN_M[1])
        weight = 1 / np.maximum(apart, _LEAST_M) ** 2
        every = np.concatenate([self._rgb, [[0, 0, 0]]])  # the last one of places without a point near
        near = (every[row] * weight[..., None]).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-9)[:, None]
        share = _synthetic(apart[:, 0])
        return near * (1 - share)[:, None] + self._rgb.mean(axis=0) * share[:, None], share
