"""Boxes of few facets of the free space, in which booleans are taken."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import manifold3d
import numpy as np

_TILE_FACETS = 150
_LEAST_M = 1.0  # of a box that is cut again


@dataclass
class Tile:
    """A part of the free space within a box; it is cut in two when somebody asks for less of it."""

    solid: manifold3d.Manifold
    low: np.ndarray
    high: np.ndarray
    halves: list[Tile] | None = None

    @classmethod
    def of(cls, solid: manifold3d.Manifold) -> Tile:
        """Return the box of a solid."""
        bounds = np.array(solid.bounding_box())
        return cls(solid, bounds[:3], bounds[3:])

    def cut(self) -> list[Tile]:
        """Return the halves across the longest side; none of a node that is small enough."""
        if self.halves is None:
            self.halves = []
            if self.solid.num_tri() > _TILE_FACETS and (self.high - self.low).max() >= _LEAST_M:
                axis = int(np.argmax(self.high - self.low))
                cuts = self.solid.split_by_plane(np.eye(3)[axis], (self.low + self.high)[axis] / 2)
                self.halves = [Tile.of(half) for half in cuts if not half.is_empty()]
        return self.halves

    def about(self, low: np.ndarray, high: np.ndarray) -> Iterator[Tile]:
        """Yield the boxes that are not cut again and meet the box from `low` to `high` (3,) m."""
        if (self.low > high).any() or (self.high < low).any():
            return
        halves = self.cut()
        if not halves:
            yield self
        for half in halves:
            yield from half.about(low, high)
