"""Boxes of few facets of the free space, in which booleans are taken."""

from __future__ import annotations

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

    def cut(self) -> list[Tile]:
        """Return the halves across the longest side; none of a node that is small enough."""
        if self.halves is None:
            self.halves = []
            if self.solid.num_tri() > _TILE_FACETS and (self.high - self.low).max() >= _LEAST_M:
                axis = int(np.argmax(self.high - self.low))
                cuts = self.solid.split_by_plane(np.eye(3)[axis], (self.low + self.high)[axis] / 2)
                self.halves = [_node(half) for half in cuts if not half.is_empty()]
        return self.halves


def drawn_tiles(solid: manifold3d.Manifold, count: int, rng: np.random.Generator) -> list[Tile]:
    """Return at most `count` different boxes of a free space, drawn by halves; it is cut only on the way to them."""
    root, found = _node(solid), dict[int, Tile]()
    for _ in range(count):
        node = root
        while halves := node.cut():
            node = halves[int(rng.integers(len(halves)))]
        found[id(node)] = node
    return list(found.values())


def _node(solid: manifold3d.Manifold) -> Tile:
    bounds = np.array(solid.bounding_box())
    return Tile(solid, bounds[:3], bounds[3:])
