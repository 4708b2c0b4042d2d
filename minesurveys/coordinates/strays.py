"""A few points far from all others: marks at 0 0 0 beside workings in the coordinates of a map, or broken values."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from minesurveys.errors import InputError

_STRAY = 100.0  # times as far from the middle as half of the points: no workings reach so far


def require_together(path: Path, points: np.ndarray, reach: float, what: str, cure: str) -> None:
    """Refuse points (n, 2 or 3) of which some lie far from the others, whatever the unit is.

    Parameters
    ----------
    path : Path
    points : (n, 2 or 3) float64
    reach : float
        How far points may lie apart, in their unit.
    what, cure : str
        What the points are, and what to do about those that lie far.

    Raises
    ------
    InputError
        The message names the first of them, and where the others lie.
    """
    if not len(points):
        return
    middle = np.median(points, axis=0)
    far = np.linalg.norm(points - middle, axis=1)
    stray = (far > reach) & (far > _STRAY * np.median(far))
    if not stray.any():
        stray = _parted(points, reach)
        middle = np.median(points[~stray], axis=0)
    if stray.any():
        first, others = (
            ", ".join(f"{value:.10g}" for value in place) for place in (points[stray.argmax()], middle.round())
        )
        raise InputError(
            f"{path}: {stray.sum()} of {len(points)} {what} lie more than {reach:g} from the others, the first at "
            f"({first}), the others about ({others}); {cure}"
        )


def _parted(points: np.ndarray, reach: float) -> np.ndarray:
    """Return which points are the smaller of two groups that a gap along an axis parts; those may be half of them."""
    gaps = np.diff(np.sort(points, axis=0), axis=0)
    axis = int(gaps.max(axis=0, initial=0.0).argmax())
    if gaps[:, axis].max(initial=0.0) <= reach:
        return np.zeros(len(points), bool)
    row = int(gaps[:, axis].argmax())
    upper = points[:, axis] > np.sort(points[:, axis])[row]
    widest = max(np.linalg.norm(np.ptp(group, axis=0)) for group in (points[upper], points[~upper]))
    if gaps[row, axis] <= _STRAY * widest:
        return np.zeros(len(points), bool)
    return np.asarray(upper if 2 * upper.sum() <= len(points) else ~upper)
