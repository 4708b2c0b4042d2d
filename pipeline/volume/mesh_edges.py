"""The directed edges of a closed mesh, and those about a vertex."""

from __future__ import annotations

from functools import cached_property
from typing import Self

import numpy as np

from minexplore.floors.volume_arrays import each_of
from pipeline.volume.union import Volume


class MeshEdges:
    """Edges sorted by start and end: each facet has one from each of its corners to the next.

    Attributes
    ----------
    start, end, third : (e,) int64
        Vertices of each edge, and the third corner of its facet.
    facet : (e,) int64
    is_rim : (e,) bool
        Whether the facet across the edge has another label; the mesh is to be closed.
    """

    def __init__(self, faces: np.ndarray, some: np.ndarray, label: np.ndarray, count: int) -> None:
        """Sort the edges of some of the facets (f, 3), which have labels (f,), of `count` vertices."""
        a, b, c = (faces[some][:, k].T.ravel() for k in ([0, 1, 2], [1, 2, 0], [2, 0, 1]))
        order = np.argsort(a * count + b)
        self.start, self.end, self.third = a[order], b[order], c[order]
        self.facet = np.tile(some, 3)[order]
        self._count, self._keys = count, self.start * count + self.end
        self._first = np.searchsorted(self.start, np.arange(count + 1))
        self._label = label

    @cached_property
    def is_rim(self) -> np.ndarray:
        """Return which edges (e,) are between labels."""
        across = np.searchsorted(self._keys, self.end * self._count + self.start)
        found: np.ndarray = self._label[self.facet] != self._label[self.facet[across]]
        return found

    @classmethod
    def of(cls, volume: Volume) -> Self:
        """Sort the edges of a volume's mesh."""
        return cls(volume.faces, np.arange(len(volume.faces)), volume.label, len(volume.vertices))

    def facets(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return the facets that have the edges from some vertices to others, which there are."""
        found: np.ndarray = self.facet[self.find(start, end)]
        return found

    def around(self, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the edges that start where some edges (n,) do, each with the number of its one in the list."""
        start = self.start[edges]
        return ranges(self._first[start], self._first[start + 1])

    def find(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return the edges (n,) from some vertices to others, -1 where there is none."""
        keys = start * self._count + end
        at = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        return np.where(self._keys[at] == keys, at, -1)

    def apart(self, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the first of some edges whose starts have no neighbour in common, and all those neighbours."""
        taken = np.zeros(self._count, bool)
        chosen, beside = [], [np.zeros(0, int)]
        for edge in edges.tolist():
            start = self.start[edge]
            ring = self.end[self._first[start] : self._first[start + 1]]
            if not taken[start] and not taken[ring].any():
                taken[ring] = taken[start] = True
                chosen.append(edge)
                beside.append(ring)
        return np.array(chosen, int), np.concatenate(beside)


def ranges(first: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers from `first` to before `end` (n,), one range after the other, each with its range's number."""
    number, step = each_of(end - first)
    return number, first[number] + step
