"""Weights of places in triangles, seen from above."""

from __future__ import annotations

import numpy as np

_NO_AREA_M2 = 1e-12  # of a triangle seen from above, twice


def second_and_third(corners: np.ndarray, number: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the second and third of `plan_weights` (n,) of places (n, 2) in triangles (t, 3, 3) with numbers (n,)."""
    (ax, bx, cx), (ay, by, cy) = corners[:, :, 0].T, corners[:, :, 1].T
    ab, ac = (bx - ax, by - ay), (cx - ax, cy - ay)
    double = ab[0] * ac[1] - ab[1] * ac[0]
    double = np.where(np.abs(double) < _NO_AREA_M2, _NO_AREA_M2, double)[number]
    x, y = places[:, 0] - ax[number], places[:, 1] - ay[number]
    return (x * ac[1][number] - y * ac[0][number]) / double, (ab[0][number] * y - ab[1][number] * x) / double


def plan_weights(vertices: np.ndarray, faces: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the barycentric weights (n, 3) of places in triangles (n, 3), seen from above."""
    v, w = second_and_third(vertices[faces], np.arange(len(faces)), places)
    return np.column_stack([1 - v - w, v, w])
