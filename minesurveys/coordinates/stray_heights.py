"""Elevations of 0 that stand for a missing value."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from minesurveys.errors import InputError

STRAY_M = 20.0  # an elevation of exactly 0 is a missing value if all others are further from 0 than this
_FEW = 0.1  # of the stations; a level at the height 0 has more


def stray_zero(places_m: np.ndarray) -> int | None:
    """Return the first station that lies at exactly 0 while all others lie on one side of 0 and far from it.

    Levels at the height 0 are none, nor is a shaft's collar: a station straight above or below another one.

    Parameters
    ----------
    places_m : (n, 3) m
        Each station once.
    """
    heights = places_m[:, 2]
    zeros, others = np.flatnonzero(heights == 0), heights[heights != 0]
    if not len(zeros) or not len(others) or (others.min() <= STRAY_M and others.max() >= -STRAY_M):
        return None
    if len(zeros) > max(1.0, _FEW * len(heights)):
        return None
    _, number, count = np.unique(places_m[:, :2], axis=0, return_inverse=True, return_counts=True)
    alone = zeros[count[number.reshape(-1)[zeros]] == 1]
    return int(alone[0]) if len(alone) else None


def require_elevations(path: Path, points_m: np.ndarray, of: str) -> None:
    """Refuse points (n, 3) m of walls or lines if an elevation of 0 is a missing value.

    Raises
    ------
    InputError
        With the first such point, the heights of the others, and the option that overrules it.
    """
    places = np.unique(points_m, axis=0)
    stray = stray_zero(places)
    if stray is None:
        return
    x, y, _ = places[stray]
    zero = places[:, 2] == 0
    others = places[~zero, 2]
    raise InputError(
        f"{path}: {zero.sum()} points of {of} have elevation 0, the first at ({x:.1f}, {y:.1f}), but the others lie "
        f"from {others.min():g} to {others.max():g} m; --no-elevation 0 takes heights from the rest of the lines, and "
        "--no-elevation -9999 keeps 0"
    )
