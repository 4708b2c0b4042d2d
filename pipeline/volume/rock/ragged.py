"""Corners of many convex parts in one array."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from minexplore.floors.volume_arrays import Parts


def parts_of(corners: Sequence[np.ndarray], label: Sequence[int] = ()) -> Parts:
    """Join the corners (k, 3) m of parts; where none are stated they have no labels."""
    first = np.concatenate([[0], np.cumsum([len(one) for one in corners])])
    joined = np.concatenate([np.zeros((0, 3)), *corners])
    return Parts(joined, first.astype(np.int32), np.array(label, np.int32))


def middles_of(parts: Parts) -> np.ndarray:
    """Return the middles (p, 3) m of the corners of parts."""
    found: np.ndarray = np.add.reduceat(parts.corners, parts.first[:-1]) / np.diff(parts.first)[:, None]
    return found


def rows_of(parts: Parts, some: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of the corners of some parts (n,), one part after the other, and where each begins (n,)."""
    count = np.diff(parts.first)[some]
    starts = np.cumsum(count) - count
    return np.arange(int(count.sum())) + np.repeat(parts.first[some] - starts, count), starts
