"""The roof of a mine with heights: above the robots, the plan is stretched upwards until its roof is the survey's.

Up to `KNEE_M` above the floor, where robots drive and sense, heights are those of the plan. Above, a height is
stretched about `KNEE_M`. Walls, visible rock and lights follow the roof so, and slices of the plan stay planes over
every triangle of the floor.
"""

from __future__ import annotations

import numpy as np

KNEE_M = 1.0
LEAST_ROOF_M = 1.5  # over the floor; floors over each other are then 2 m apart or more
MOST_ROOF_M = 30.0  # over the floor
LEAST_STRETCH = 0.1  # heights in a file have four decimals; so have those of the plan, to a millimetre


def stretch_of(roof_m: np.ndarray, height_m: float) -> np.ndarray:
    """Return how much (n,) a plan with a roof `height_m` over the floor is stretched to have it at `roof_m` (n,)."""
    return np.asarray((roof_m - KNEE_M) / (height_m - KNEE_M))


def least_roof_m(height_m: float) -> float:
    """Return the lowest roof over the floor, m, that a plan with a roof at a height can be stretched to."""
    return max(LEAST_ROOF_M, KNEE_M + LEAST_STRETCH * (height_m - KNEE_M))


def raise_m(above_m: np.ndarray | float, stretch: np.ndarray | float) -> np.ndarray:
    """Return the heights (n,) m over the floor of points at heights over it in the plan."""
    return np.asarray(np.minimum(above_m, KNEE_M) + np.maximum(np.subtract(above_m, KNEE_M), 0.0) * stretch)


def lower_m(above_m: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Return the heights (n,) m in the plan of points at heights over the floor."""
    return np.asarray(np.minimum(above_m, KNEE_M) + np.maximum(above_m - KNEE_M, 0.0) / stretch)
