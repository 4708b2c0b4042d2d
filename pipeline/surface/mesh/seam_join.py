"""Points where the rock of two sheets meets: what both have there in common."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class SeamJoin:
    """Points (k,) of a lattice that lie on seams, and the number of the place of each; two sheets have one place.

    `near` (m,) are the points near a seam, `nearest` (m,) which of the points on it is nearest to each, and `weight`
    (m,) falls from 1 on the seam to 0.
    """

    points: np.ndarray
    place: np.ndarray
    near: np.ndarray
    nearest: np.ndarray
    weight: np.ndarray

    def meet(self, values: np.ndarray) -> np.ndarray:
        """Return values (n, ...) that two sheets have in common on their seams: their mean; differences fade."""
        flat = values.reshape(len(values), -1).astype(np.float64)
        own, count = flat[self.points], np.bincount(self.place)
        mean = np.column_stack([np.bincount(self.place, column) / count for column in own.T])
        flat[self.near] += self.weight[:, None] * (mean[self.place] - own)[self.nearest]
        return flat.reshape(values.shape)

    def join(self, vertices: np.ndarray, offset_m: np.ndarray) -> np.ndarray:
        """Return vertices (n, 3) m, those on seams at the first one's place; `offset_m` (n, 2) is of their sheets."""
        first = np.unique(self.place, return_index=True)[1]
        joined = vertices.copy()
        source = self.points[first][self.place]
        joined[self.points] = vertices[source]
        joined[self.points, :2] += offset_m[self.points] - offset_m[source]
        return np.round(joined, 4)
