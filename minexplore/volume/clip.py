"""Convex parts cut to a box: what a robot cannot reach of a part makes its model slower."""

from __future__ import annotations

import numpy as np
import shapely

_LINE = 2  # corners


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
            crossing = ((inner[:, None] * far + outer[None] * near) / (near + far)).reshape(-1, 3)
            hull = shapely.convex_hull(shapely.multipoints(np.delete(crossing, axis, axis=1)))
            ring = shapely.get_coordinates(hull)  # of an area, closed by its first corner
            section = ring[:-1] if len(ring) > _LINE else ring
            corners_m = np.concatenate([inner, np.insert(section, axis, limit, axis=1)])
    return corners_m
