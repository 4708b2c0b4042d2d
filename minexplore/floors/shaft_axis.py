"""Shafts that lean: how far aside their section lies at a height, and their fences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

Bends = Sequence[Sequence[float]]


def aside_at(bends_m: Bends, heights_m: np.ndarray | float) -> np.ndarray:
    """Return how far (..., 2) m aside of its outline a shaft's section lies at heights (...) m, mine frame.

    Parameters
    ----------
    bends_m : sequence of (x, y, z), m, from the highest down
        Of a plumb shaft there are none.
    heights_m : float64, m
    """
    heights = np.asarray(heights_m, dtype=np.float64)
    if not len(bends_m):
        return np.zeros((*heights.shape, 2))
    x, y, z = np.array(bends_m, dtype=np.float64)[::-1].T
    return np.stack([np.interp(heights, z, x), np.interp(heights, z, y)], axis=-1)


def has_fence(opening: Mapping[str, Any], fenced: bool) -> bool:
    """Return whether an opening of a record has a fence: in a fenced world each in a floor, else those that lean."""
    return opening["sheet"] is not None and (fenced or "bends_m" in opening)
