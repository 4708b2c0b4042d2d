"""The smoothest curve that a digitised outline allows: steps of the pixel grid are removed, corners stay."""

from __future__ import annotations

import math

import numpy as np

from pipeline.types import Points2

_HALF_WIDTHS = (2, 4, 8, 16, 32, 64, 128, 256)  # vertices on each side; about 0.8 px apart
_MARGIN_PX = 0.02
_CHUNK_VALUES = 500_000  # of windows that are fitted at once


def straighten(ring: Points2, slack_px: np.ndarray) -> Points2:
    """Move each vertex to a parabola fitted to the widest window of its neighbours that the pixels allow.

    A window is allowed if no vertex in it lies farther across the parabola than its slack. Windows are doubled as long
    as they are allowed. A long window removes the steps of a straight wall; at a corner none is allowed, and the vertex
    stays.

    Parameters
    ----------
    ring : (n, 2) float64, px
        Closed ring: the last point repeats the first.
    slack_px : (n,) float64
        How far the true outline may lie from each vertex.

    Returns
    -------
    (n, 2) float64, px
        Closed ring.

    References
    ----------
    The window is a blurred segment of order two (Debled-Rennesson et al. 2006, doi:10.1016/j.dam.2004.11.001); the fit
    is that of Savitzky & Golay 1964, doi:10.1021/ac60214a047.
    """
    points, slack = ring[:-1], slack_px[:-1] + _MARGIN_PX
    result = points.copy()
    growing = np.arange(len(points))
    for half in _HALF_WIDTHS:
        if 2 * half + 1 > len(points) // 2:
            break
        fitted, holds = _fit_windows(points, slack, growing, half)
        growing = growing[holds]
        result[growing] = fitted[holds]
    return np.vstack([result, result[:1]])


def _fit_windows(points: Points2, slack: np.ndarray, at: np.ndarray, half: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the fitted place (k, 2) at each of the vertices `at`, and whether its window is allowed (k,).

    Sums are written out, because BLAS may round a product differently on another processor.
    """
    k = np.arange(-half, half + 1)
    basis = _parabolas(k)
    fitted, holds = np.empty((len(at), 2)), np.empty(len(at), dtype=bool)
    step = max(1, _CHUNK_VALUES // len(k))
    for start in range(0, len(at), step):
        part = slice(start, start + step)
        window = (at[part, None] + k) % len(points)
        places = points[window]
        share = sum(basis[i, :, None] * places[:, i, None] for i in range(len(k)))  # (rows, 3, 2)
        curve = sum(basis[:, j, None] * share[:, j, None] for j in range(3))
        tangent = np.gradient(curve, axis=1)
        tangent /= np.maximum(np.linalg.norm(tangent, axis=2, keepdims=True), 1e-12)
        off = places - curve
        across = np.abs(off[..., 0] * tangent[..., 1] - off[..., 1] * tangent[..., 0])
        fitted[part], holds[part] = curve[:, half], (across <= slack[window]).all(axis=1)
    return fitted, holds


def _parabolas(k: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (n, 3) of the parabolas over whole numbers k (n,) whose sum is 0."""
    square = k * k - (k * k).sum() / len(k)
    columns = [np.ones(len(k)), k, square]
    return np.column_stack([column / math.sqrt(math.fsum(column * column)) for column in columns])
