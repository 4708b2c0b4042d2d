"""Lengths along a polyline."""

from __future__ import annotations

import numpy as np


def arc_length(points: np.ndarray) -> np.ndarray:
    """Return the length along a polyline from its first point to each of its points.

    Parameters
    ----------
    points : (n, k) m
        At least one point, in two or three dimensions.

    Returns
    -------
    (n,) m
        Zero first, the polyline's length last.
    """
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
