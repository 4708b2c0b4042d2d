"""Convex parts cut to a box: what a robot cannot reach of a part makes its model slower."""

from __future__ import annotations

import numpy as np


def clip_convex(corners_m: np.ndarray, low_m: np.ndarray, high_m: np.ndarray) -> np.ndarray:
    """Return the corners (k, 3) m of a convex part that is cut to a box from `low_m` (3,) to `high_m` (3,).

    Each plane keeps the corners before it. Where it cuts the part, the section is the hull of all segments' crossings
    from a corner before it to one behind it. There are no corners left if the part is outside.
    """
    for axis in range(3):
        for limit, sign in ((low_m[axis], 1.0), (high_m[axis], -1.0)):
            depth = sign * (corners_m[:, axis] - limit)
            if (depth >= 0).all():
                continue
            inner, outer = corners_m[depth >= 0], corners_m[depth < 0]
            if not len(inner):
                return inner
            near, far = depth[depth >= 0][:, None, None], -depth[depth < 0][None, :, None]
            crossing = (inner[:, None] * far + outer[None] * near) / (near + far)
            section = crossing.reshape(-1, 3)
            section[:, axis] = limit
            corners_m = np.concatenate([inner, section[_hull(np.delete(section, axis, axis=1))]])
    return corners_m


def _hull(places: np.ndarray) -> list[int]:
    """Return which of places (n, 2) are corners of their hull (Andrew's monotone chain)."""
    points = places.tolist()
    order = sorted(range(len(points)), key=points.__getitem__)
    found: list[int] = []
    for way in (order, order[::-1]):
        chain: list[int] = []
        for k in way:
            while len(chain) > 1 and _turn(points[chain[-2]], points[chain[-1]], points[k]) <= 0:
                chain.pop()
            chain.append(k)
        found += chain[:-1] if len(chain) > 1 else chain
    return list(dict.fromkeys(found))


def _turn(a: list[float], b: list[float], c: list[float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
