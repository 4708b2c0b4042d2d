"""A mesh whose plumb ledges are cut at the places of their corners."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.volume.union import Volume

_PLUMB = 0.02  # of a facet's normal: so steep a ledge has no area seen from above
_ONE_PLACE_M = 1e-3  # seen from above: corners that are nearer get one height


def cut_ledges(volume: Volume, is_ledge: np.ndarray) -> tuple[Volume, np.ndarray, np.ndarray]:
    """Return the mesh with cut ledges, the first (v,) of the corners over each other, and each facet's parent (f,)."""
    normal = volume.normals
    plumb = is_ledge & (np.abs(normal[:, 2]) < _PLUMB * np.linalg.norm(normal, axis=1))
    uncut = _uncut(volume, plumb)
    mesh = _Cuts(volume, plumb, _joined(volume, plumb, uncut))
    for facet in uncut.tolist():
        mesh.part(facet)
    vertices, faces, parent = mesh.mesh()
    cut = replace(volume, vertices=vertices, faces=faces, source=volume.source[parent], label=volume.label[parent])
    a, b = (np.concatenate([faces[plumb[parent]][:, k] for k in order]) for order in ((0, 1, 2), (1, 2, 0)))
    over = np.linalg.norm((vertices[a] - vertices[b])[:, :2], axis=1) < _ONE_PLACE_M
    n = len(vertices)
    _, group = connected_components(coo_matrix((np.ones(over.sum()), (a[over], b[over])), (n, n)), directed=False)
    _, first = np.unique(group, return_index=True)
    return cut, first[group], parent


def _uncut(volume: Volume, plumb: np.ndarray) -> np.ndarray:
    """Return the plumb facets (n,) whose middle corner is to be cut at; `_Cuts.part` tries them again."""
    facets = np.flatnonzero(plumb)
    places = volume.vertices[volume.faces[facets], :2]
    sides = np.roll(places, -1, axis=1) - places
    length = np.linalg.norm(sides, axis=2)
    longest = length.argmax(axis=1)
    row = np.arange(len(facets))
    along = np.einsum("nk,nk->n", places[row, longest - 1] - places[row, longest], sides[row, longest])
    most = length[row, longest]
    along /= np.maximum(most, _ONE_PLACE_M)
    inside = (along > _ONE_PLACE_M / 2) & (along < most - _ONE_PLACE_M / 2)
    return facets[(length.min(axis=1) >= _ONE_PLACE_M) & inside]


def _joined(volume: Volume, plumb: np.ndarray, some: np.ndarray) -> np.ndarray:
    """Return which facets (f,) are plumb and joined to some of these (n,) by plumb ones: cuts get no farther."""
    facets, n = np.flatnonzero(plumb), len(volume.vertices)
    faces = volume.faces[facets]
    edges = (faces.ravel(), np.roll(faces, -1, axis=1).ravel())
    _, group = connected_components(coo_matrix((np.ones(faces.size), edges), (n, n)), directed=False)
    found = np.zeros(len(plumb), bool)
    found[facets[np.isin(group[faces[:, 0]], group[volume.faces[some, 0]])]] = True
    return found


class _Cuts:
    """A mesh of which facets are parted."""

    def __init__(self, volume: Volume, plumb: np.ndarray, some: np.ndarray) -> None:
        """Begin with a volume's mesh; edges are looked up beside some of the plumb facets alone."""
        self.vertices, self.faces = volume.vertices, volume.faces
        self._places: dict[int, list[float]] = {}
        self._added: list[list[float]] = []
        self._parents: list[int] = []
        self._plumb = plumb
        corner = np.zeros(len(volume.vertices), bool)
        corner[volume.faces[some]] = True
        beside = np.flatnonzero(corner[volume.faces].sum(axis=1) >= 2)
        self._ours = dict(zip(beside.tolist(), volume.faces[beside].tolist(), strict=True))
        self._facet = {(face[i], face[i - 2]): k for k, face in self._ours.items() for i in range(3)}

    def part(self, facet: int) -> None:
        """Part a plumb facet, and what comes of it, until each has two corners over each other."""
        stack = [facet]
        while stack:
            face = self._ours[stack.pop()]
            places = [self._place(k) for k in face]
            length = [hypot(p[0] - q[0], p[1] - q[1]) for p, q in zip(places, places[1:] + places[:1], strict=True)]
            if min(length) < _ONE_PLACE_M:
                continue
            i = length.index(max(length))
            (x, y, z), (u, v, w), (s, t, _) = places[i], places[i - 2], places[i - 1]
            share = ((s - x) * (u - x) + (t - y) * (v - y)) / length[i] ** 2
            if not _ONE_PLACE_M < share * length[i] < length[i] - _ONE_PLACE_M:
                continue
            self._added.append([s, t, (1 - share) * z + share * w])
            for one, two in ((face[i], face[i - 2]), (face[i - 2], face[i])):
                stack += self._halve(one, two, len(self.vertices) + len(self._added) - 1)

    def _halve(self, a: int, b: int, middle: int) -> list[int]:
        """Part the facet that has the edge from a to b; return the plumb ones among its halves."""
        facet = self._facet.pop((a, b))
        c = next(k for k in self._ours[facet] if k not in (a, b))
        other = len(self.faces) + len(self._parents)
        self._ours[facet], self._ours[other] = [a, middle, c], [middle, b, c]
        self._parents.append(self._parent(facet))
        self._facet |= {(a, middle): facet, (middle, c): facet, (c, a): facet}
        self._facet |= {(middle, b): other, (b, c): other, (c, middle): other}
        return [facet, other] if self._plumb[self._parent(facet)] else []

    def mesh(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the vertices (v, 3) m, the facets (f, 3), and the facet (f,) that each is of."""
        count = len(self.faces)
        faces = np.concatenate([self.faces, np.zeros((len(self._parents), 3), int)])
        faces[list(self._ours)] = np.array(list(self._ours.values())).reshape(-1, 3)
        vertices = np.concatenate([self.vertices, np.array(self._added).reshape(-1, 3)])
        return vertices, faces, np.concatenate([np.arange(count), np.array(self._parents, int)])

    def _parent(self, facet: int) -> int:
        return facet if facet < len(self.faces) else self._parents[facet - len(self.faces)]

    def _place(self, vertex: int) -> list[float]:
        if vertex >= len(self.vertices):
            return self._added[vertex - len(self.vertices)]
        if vertex not in self._places:
            self._places[vertex] = self.vertices[vertex].tolist()
        return self._places[vertex]
