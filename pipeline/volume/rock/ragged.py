"""Corners of many convex parts in one array."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np


@dataclass(frozen=True)
class PartCorners:
    """Corners (c, 3) m of parts, one part after the other; part i has `first[i]` to `first[i + 1]`."""

    corners: np.ndarray
    first: np.ndarray

    @classmethod
    def of(cls, parts: Sequence[np.ndarray]) -> Self:
        """Join the corners (k, 3) of parts."""
        first = np.concatenate([[0], np.cumsum([len(part) for part in parts])]).astype(np.int64)
        return cls(np.concatenate([np.zeros((0, 3)), *parts]), first)

    def __len__(self) -> int:
        """Return the number of parts."""
        return len(self.first) - 1

    def __getitem__(self, number: int) -> np.ndarray:
        """Return the corners (k, 3) m of a part."""
        return self.corners[self.first[number] : self.first[number + 1]]

    def boxes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the least and the largest coordinates (n, 3) m of the parts."""
        starts = self.first[:-1]
        return np.minimum.reduceat(self.corners, starts), np.maximum.reduceat(self.corners, starts)

    def rows(self, parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the rows of the corners of some parts (n,), one part after the other, and where each begins (n,)."""
        count = np.diff(self.first)[parts]
        starts = np.cumsum(count) - count
        return np.arange(int(count.sum())) + np.repeat(self.first[parts] - starts, count), starts
