"""Distances along a polyline."""

from __future__ import annotations

import numpy as np


def arc_length(points: np.ndarray) -> np.ndarray:
    """Return the length along a polyline from its first point to each of its points.

    Parameters
    ----------
    points : (n, k) m
        At least one point; k is 2 or 3.

    Returns
    -------
    (n,) m
        From zero to the length of the polyline.
    """
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def resample(path: np.ndarray, spacing_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Place points at even distances along a polyline.

    Parameters
    ----------
    path : (k, 2) m
    spacing_m : float
        The distance is the nearest to this that divides the length evenly.

    Returns
    -------
    chainage : (n,) m
    points : (n, 2) m
        The ends of the polyline included.
    """
    along = arc_length(path)
    chainage = np.linspace(0.0, along[-1], max(2, round(along[-1] / spacing_m) + 1))
    return chainage, np.column_stack([np.interp(chainage, along, path[:, k]) for k in (0, 1)])
