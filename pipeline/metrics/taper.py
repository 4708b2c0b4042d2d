"""Remove the trend of a series and taper it; as in `scipy.signal`, which takes half a second to import."""

from __future__ import annotations

import numpy as np


def hann(count: int) -> np.ndarray:
    """Return the symmetric Hann window (count,), at least two values."""
    return 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(count) / (count - 1))


def detrend(values: np.ndarray) -> np.ndarray:
    """Return values (n,), at least two, less the straight line that fits them best by least squares."""
    place = np.arange(len(values)) - (len(values) - 1) / 2
    offset = values - values.mean()
    return offset - place * ((place * offset).sum() / (place * place).sum())
