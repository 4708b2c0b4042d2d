"""The origin that coordinates far from zero get."""

from __future__ import annotations

import numpy as np

_OWN_M = 1000.0  # coordinates beyond get an origin of their own, rounded to 10 m


def origin_of(points: np.ndarray, metres: float) -> tuple[float, float, float]:
    """Return an origin in the file's coordinates: a height in whole metres, and zero in plan if that is near."""
    low = points.min(axis=0) * metres
    plan = [0.0 if np.abs(points[:, k] * metres).max() <= _OWN_M else np.floor(low[k] / 10) * 10 for k in (0, 1)]
    x, y, z = (float(value / metres) for value in (*plan, np.floor(low[2])))
    return x, y, z
