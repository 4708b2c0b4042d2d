"""The free space cut into boxes of few facets, so that a part meets few of them."""

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

    def cut(self) -> list[Tile]:
        """Return the halves across the longest side; none of a node that is small enough."""
        if self.halves is None:
            self.halves = []
            if self.solid.num_tri() > _TILE_FACETS and (self.high - self.low).max() >= _LEAST_M:
                axis = int(np.argmax(self.high - self.low))
                cuts = self.solid.split_by_plane(np.eye(3)[axis], (self.low + self.high)[axis] / 2)
                self.halves = [_node(half) for half in cuts if not half.is_empty()]
        return self.halves


class Tiles:
    """The free space in boxes, cut only where a part is measured."""

    def __init__(self, solid: manifold3d.Manifold) -> None:
        """Begin with the whole solid."""
        self._root = _node(solid)

    def drawn(self, count: int, rng: np.random.Generator) -> list[Tile]:
        """Return at most `count` different tiles, drawn by halves; their boxes are `low` and `high`."""
        found: dict[int, Tile] = {}
        for _ in range(count):
            node = self._root
            while halves := node.cut():
                node = halves[int(rng.integers(len(halves)))]
            found[id(node)] = node
        return list(found.values())

    def near(self, low: np.ndarray, high: np.ndarray) -> Iterator[manifold3d.Manifold]:
        """Return the pieces of the free space that reach into a box."""
        stack = [self._root]
        while stack:
            node = stack.pop()
            if not ((node.low < high).all() and (node.high > low).all()):
                continue
            halves = node.cut()
            stack += halves
            if not halves:
                yield node.solid

    def shared_m3(self, part: manifold3d.Manifold) -> float:
        """Return the volume that a part shares with the free space."""
        bounds = np.array(part.bounding_box())
        return sum(abs((part ^ one).volume()) for one in self.near(bounds[:3], bounds[3:]))


def _node(solid: manifold3d.Manifold) -> Tile:
    bounds = np.array(solid.bounding_box())
    return Tile(solid, bounds[:3], bounds[3:])
