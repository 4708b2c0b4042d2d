"""Colours of points, as columns after their coordinates. Black is no colour: scanners write it where no camera saw."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

MOST = 65_535  # of a channel: LAS has 16 bits


def with_colours(points: np.ndarray, channels: Sequence[np.ndarray] | np.ndarray) -> np.ndarray:
    """Return points (n, 3) with red, green and blue, (n,) each, as columns 3 to 5.

    A colour with a channel that is no number from 0 to 65,535 is none: black.
    """
    colours = np.column_stack([np.asarray(channel, float) for channel in channels])
    with np.errstate(invalid="ignore"):
        colours[~((colours >= 0) & (colours <= MOST)).all(axis=1)] = 0.0
    return np.column_stack([points, colours])


def mean_colours(sums: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Return the means (n, 3) uint8 of sums of colours (n, 3) over `count` (n,) points each.

    Where no point has a colour it is black; there are none, (0, 3), if no point has. Values beyond 255 are taken for 16
    bits, values of 1 at most for shares.
    """
    seen = count > 0
    if not seen.any():
        return np.zeros((0, 3), np.uint8)
    means = sums / np.maximum(count, 1)[:, None]
    most = float(means.max())
    means *= 255.0 if most <= 1 else 1.0 if most <= 255 else 255 / MOST
    return np.asarray(np.rint(means), np.uint8)
