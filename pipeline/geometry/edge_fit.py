"""Straighten a simplified ring: fit each edge to its stretch of the traced ring."""

from __future__ import annotations

import numpy as np
import shapely

from pipeline.types import Points2


def fit_edges(traced: Points2, kept: Points2, tolerance_m: float) -> Points2:
    """Fit a line to each edge's stretch of the traced wall and move each vertex to where two lines meet.

    Douglas-Peucker keeps the extreme points of a ragged wall, so a long edge runs along the wall's fringe and not along
    its middle. A vertex moves at most by the tolerance, and only if the traced vertices of its two edges stay within
    the tolerance of those edges.

    Parameters
    ----------
    traced : (n, 2) float64, m
        Closed ring: the last point repeats the first.
    kept : (k, 2) float64, m
        Closed ring of points that Douglas-Peucker kept of `traced`, in the same order.
    tolerance_m : float

    Returns
    -------
    (k, 2) float64, m
        Closed ring.
    """
    runs = _runs(traced, kept)
    lines = [_fit_line(run) for run in runs]
    corners = kept[:-1]
    moved = np.array([_intersection(lines[i - 1], lines[i], corners[i], tolerance_m) for i in range(len(corners))])
    following = np.roll(np.arange(len(corners)), -1)
    while True:
        ends = [i for i, run in enumerate(runs) if _max_distance(run, moved[i], moved[following[i]]) > tolerance_m]
        ends += [int(following[i]) for i in ends]
        # An edge too far from its stretch gets its old vertices back.
        restored = [i for i in ends if not np.array_equal(moved[i], corners[i])]
        if not restored:
            return np.vstack([moved, moved[:1]])
        moved[restored] = corners[restored]


def _runs(traced: Points2, kept: Points2) -> list[Points2]:
    """Return the stretch of the traced ring that each edge of the kept ring replaces."""
    place = {xy.tobytes(): i for i, xy in enumerate(traced[:-1])}
    at = [place[xy.tobytes()] for xy in kept[:-1]]
    n = len(traced) - 1
    return [traced[:-1][(a + np.arange((b - a) % n + 1)) % n] for a, b in zip(at, [*at[1:], at[0]], strict=True)]


def _fit_line(run: Points2) -> tuple[np.ndarray, np.ndarray]:
    """Return a point and the unit direction of the line fitted to a polyline, weighted by length."""
    step = np.diff(run, axis=0)
    weight = np.linalg.norm(step, axis=1)
    middle = (run[:-1] + run[1:]) / 2
    centre = weight @ middle / weight.sum()
    off = middle - centre
    # Second moment of the segments, not only of their midpoints.
    moment = (
        weight[:, None, None] * (off[:, :, None] * off[:, None, :] + step[:, :, None] * step[:, None, :] / 12)
    ).sum(0)
    return centre, np.linalg.eigh(moment)[1][:, 1]


def _intersection(one: tuple, two: tuple, corner: np.ndarray, tolerance_m: float) -> np.ndarray:
    (p, u), (q, v) = one, two
    cross = u[0] * v[1] - u[1] * v[0]
    if abs(cross) < 0.05:  # the intersection of nearly parallel lines is ill-conditioned
        return corner
    t = ((q[0] - p[0]) * v[1] - (q[1] - p[1]) * v[0]) / cross
    place = p + t * u
    return place if np.linalg.norm(place - corner) <= tolerance_m else corner


def _max_distance(run: Points2, start: np.ndarray, end: np.ndarray) -> float:
    return float(shapely.distance(shapely.points(run), shapely.LineString([start, end])).max())
