"""Points along the level slice of a mesh."""

from __future__ import annotations

import numpy as np

_APART_M = 0.1


def slice_points(triangles: np.ndarray, height_m: float) -> np.ndarray:
    """Return points (n, 2) m along the level slice of triangles (m, 3, 3) m, at most 0.1 m apart."""
    above = triangles[:, :, 2] > height_m
    cut = triangles[above.any(axis=1) & ~above.all(axis=1)]
    ends = []
    for start, end in ((0, 1), (1, 2), (2, 0)):
        a, b = cut[:, start], cut[:, end]
        crosses = (a[:, 2] > height_m) != (b[:, 2] > height_m)
        share = (height_m - a[:, 2]) / np.where(crosses, b[:, 2] - a[:, 2], 1.0)
        ends.append(np.where(crosses[:, None], a[:, :2] + share[:, None] * (b[:, :2] - a[:, :2]), np.nan))
    sides = np.stack(ends, axis=1)  # two of the three are numbers
    order = np.argsort(np.isnan(sides[:, :, 0]), axis=1, kind="stable")
    segment = np.take_along_axis(sides, order[:, :2, None], axis=1)
    length = np.linalg.norm(segment[:, 1] - segment[:, 0], axis=1)
    count = np.maximum(2, np.ceil(length / _APART_M).astype(int) + 1)
    owner = np.repeat(np.arange(len(segment)), count)
    step = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    share = (step / (count[owner] - 1))[:, None]
    return segment[owner, 0] * (1 - share) + segment[owner, 1] * share
