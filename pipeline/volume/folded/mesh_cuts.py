"""A closed mesh of which edges and facets are parted."""

from __future__ import annotations

import numpy as np

from pipeline.volume.union import Volume


class MeshCuts:
    """A mesh to which vertices are added; each facet knows the one that it is cut from."""

    def __init__(self, volume: Volume, some: np.ndarray) -> None:
        """Begin with a volume's mesh; edges are looked up beside some facets (f,) alone."""
        self._vertices, self._faces = volume.vertices, volume.faces
        self._places: dict[int, list[float]] = {}
        self._added: list[list[float]] = []
        self._parents: list[int] = []
        corner = np.zeros(len(volume.vertices), bool)
        corner[volume.faces[some]] = True
        beside = np.flatnonzero(corner[volume.faces].sum(axis=1) >= 2)
        self.corners = dict(zip(beside.tolist(), volume.faces[beside].tolist(), strict=True))
        self._facet = {(face[i], face[i - 2]): k for k, face in self.corners.items() for i in range(3)}

    def place(self, vertex: int) -> list[float]:
        """Return where a vertex is, m."""
        if vertex >= len(self._vertices):
            return self._added[vertex - len(self._vertices)]
        if vertex not in self._places:
            self._places[vertex] = self._vertices[vertex].tolist()
        return self._places[vertex]

    def parent(self, facet: int) -> int:
        """Return the facet of the uncut mesh that one is of."""
        return facet if facet < len(self._faces) else self._parents[facet - len(self._faces)]

    def across(self, a: int, b: int) -> int | None:
        """Return the facet that has the edge from b to a, None if it is not looked up."""
        return self._facet.get((b, a))

    def part_edge(self, a: int, b: int, place: list[float]) -> list[int]:
        """Put a vertex on an edge; return the halves of the facets on both sides."""
        self._added.append(place)
        middle = len(self._vertices) + len(self._added) - 1
        return self._halve(a, b, middle) + self._halve(b, a, middle)

    def part_facet(self, facet: int, place: list[float]) -> list[int]:
        """Put a vertex into a facet; return its three parts."""
        a, b, c = self.corners[facet]
        self._added.append(place)
        middle = len(self._vertices) + len(self._added) - 1
        found = [facet, self._new(facet), self._new(facet)]
        for part, (start, end) in zip(found, ((a, b), (b, c), (c, a)), strict=True):
            self._set(part, [start, end, middle])
        return found

    def mesh(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the vertices (v, 3) m, the facets (f, 3), and the facet (f,) that each is of."""
        count = len(self._faces)
        faces = np.concatenate([self._faces, np.zeros((len(self._parents), 3), int)])
        if self.corners:
            faces[list(self.corners)] = np.array(list(self.corners.values()))
        vertices = np.concatenate([self._vertices, np.array(self._added).reshape(-1, 3)])
        return vertices, faces, np.concatenate([np.arange(count), np.array(self._parents, int)])

    def _halve(self, a: int, b: int, middle: int) -> list[int]:
        facet = self._facet.pop((a, b))
        c = next(k for k in self.corners[facet] if k not in (a, b))
        other = self._new(facet)
        self._set(facet, [a, middle, c])
        self._set(other, [middle, b, c])
        return [facet, other]

    def _new(self, facet: int) -> int:
        self._parents.append(self.parent(facet))
        return len(self._faces) + len(self._parents) - 1

    def _set(self, facet: int, corners: list[int]) -> None:
        self.corners[facet] = corners
        a, b, c = corners
        self._facet |= {(a, b): facet, (b, c): facet, (c, a): facet}
