"""How fine coordinates are: numbers of 32 bits come in steps, which grow with their distance from the origin."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from minesurveys.errors import InputError
from minesurveys.remarks import warn_user

MOST_M = 0.01  # of a step: walls that lie between two are moved by half of it, as far as surveys are exact
_NAMED_M = 0.001  # steps below are finer than any survey
_LEAST_POINTS = 100  # by which steps in a text are no chance
_FAR = 1e5  # from the origin: 8 digits then leave steps of 1 cm, and 32 bits of 0.8 cm
_CUT = (0.1, 1.0, 10.0, 100.0)  # steps of numbers without their last digits
_SAME = 1e-5  # of a step: numbers of 64 bits, up to 1e10 steps from the origin
_CURE = "export it with a local origin near the workings, so that its coordinates are below 1,000 m"


def steps_of_floats(values: np.ndarray) -> np.ndarray:
    """Return the step (3,) of numbers of 32 bits as large as the largest of points (n, 3), along each axis."""
    largest = np.abs(values).max(axis=0, initial=0.0).astype(np.float32)
    return np.spacing(largest).astype(float)


def steps_seen(points: np.ndarray) -> np.ndarray:
    """Return the step (3,) in which points (n, 3) come along each axis, zero where none is seen.

    Steps are those of numbers of 32 bits, and of texts that were cut to 6, 7 or 8 digits. They are seen where another
    axis is finer: points on a grid are as coarse along all of them. Near the origin no digits are missing.
    """
    found = np.zeros(3)
    if len(points) < _LEAST_POINTS:
        return found
    for axis in np.flatnonzero(np.abs(points).max(axis=0) >= _FAR):
        for step in sorted({float(steps_of_floats(points)[axis]), *_CUT}):
            if _is_multiple(points[:, axis], step) and not all(_is_multiple(points[:, k], step) for k in range(3)):
                found[axis] = step
    return found


def _is_multiple(values: np.ndarray, step: float) -> bool:
    return bool(np.abs(values / step - np.rint(values / step)).max() < _SAME)


def require_fine(path: Path, steps_m: np.ndarray, is_sure: bool = True) -> None:
    """Refuse coordinates in steps (3,) of more than 1 cm, and warn of those of more than 1 mm.

    Steps that are not `sure`, as a model may have been drawn on a grid, are only warned of.

    Raises
    ------
    InputError
        The message names the file, the axis, the step and the limit.
    """
    axis = int(steps_m.argmax())
    step_m = float(steps_m[axis])
    if step_m <= _NAMED_M:
        return
    what = f"its {'xyz'[axis]} coordinates come in steps of {step_m:.2g} m, so far from the origin do they lie"
    if step_m > MOST_M and is_sure:
        raise InputError(f"{path}: {what}; at most {MOST_M:g} m is read: {_CURE}")
    warn_user(f"{what}: {_CURE}", of=path.name)
