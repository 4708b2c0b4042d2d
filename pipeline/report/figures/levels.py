"""A long section on paper: its direction, and how large heights are drawn."""

from __future__ import annotations

import numpy as np

_WIDE_IN = 9.0
_SECTION_IN = 3.0  # the tallest section whose heights are drawn larger
_TIMES = (10, 5, 2)


def times_as_high(wide_m: float, high_m: float) -> int:
    """Return how many times as large heights are drawn, so that a long mine's section is not a line."""
    return next((k for k in _TIMES if k * high_m / wide_m * _WIDE_IN < _SECTION_IN), 1)


def long_axis(places_m: np.ndarray) -> np.ndarray:
    """Return the direction (2,) along which places (k, 2) spread most, towards the east."""
    _, vectors = np.linalg.eigh(np.cov(places_m.T))
    axis = vectors[:, -1]
    return axis if (axis[0], axis[1]) > (0, 0) else -axis
