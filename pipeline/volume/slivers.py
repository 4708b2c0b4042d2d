"""A closed mesh without its shortest edges and flattest facets, which no convex part stands behind."""

from __future__ import annotations

from dataclasses import replace

import manifold3d
import numpy as np

from pipeline.geometry.facets.crossings import CROSSING_M, crosses_more
from pipeline.volume.labelled_solid import KeyedSolid, keyed, near_facets, volume_of
from pipeline.volume.union import Volume, mesh_of

SHORT_M = 0.003  # of an edge, and of a facet's height over its longest edge: floors keep within 1 cm of the survey
_TURN = 0.2  # of the cosine between a facet's normals before and after: more turns it over
_ROUNDS, _TRIES = 4, 3
_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])  # after each of three, and before it


def without_slivers(
    volume: Volume, short_m: float = SHORT_M, stays: np.ndarray | None = None, kept: np.ndarray | None = None
) -> Volume:
    """Return the volume without edges shorter than `short_m`, m, and facets lower than that, where it stays closed.

    A short edge becomes one vertex, unless one of its ends `stays` (v,). A low facet gives its longest edge to the
    facet beyond, which is parted at its third corner, and keeps its label. What would turn another facet over, or cross
    it, stays, and so do facets of `kept` (f,).
    """
    if stays is None:
        stays = np.zeros(len(volume.vertices), bool)
    kept = np.zeros(len(volume.faces), bool) if kept is None else kept.copy()
    before = volume.vertices, volume.faces
    for _ in range(_TRIES):
        found = _cleaned(volume, kept, stays, short_m)
        if found is None:
            return volume
        vertices, faces, _ = mesh_of(found.solid, found.keys)
        crossing = crosses_more(vertices, faces, before, CROSSING_M)
        if not len(crossing):
            return volume_of(found, volume)
        kept |= near_facets(volume.vertices[volume.faces], vertices[faces[crossing]], short_m)
    return volume


def _cleaned(volume: Volume, kept: np.ndarray, stays: np.ndarray, short_m: float) -> KeyedSolid | None:
    """Return the volume without slivers but those of some facets; None if it is not closed then."""
    mesh = _Mesh(volume, kept, stays, short_m)
    for _ in range(_ROUNDS):
        if not mesh.collapse() + mesh.flip():
            break
    used = np.unique(mesh.faces[mesh.alive])
    number = np.full(len(mesh.vertices), -1)
    number[used] = np.arange(len(used))
    vertices, faces = mesh.vertices[used], number[mesh.faces[mesh.alive]]
    found = replace(
        volume, vertices=vertices, faces=faces, source=mesh.source[mesh.alive], label=mesh.label[mesh.alive]
    )
    one = keyed(found, found.vertices, found.label)
    return one if one.solid.status() == manifold3d.Error.NoError else None


class _Mesh:
    """A closed mesh of which edges are collapsed and flipped."""

    def __init__(self, volume: Volume, kept: np.ndarray, stays: np.ndarray, short_m: float) -> None:
        """Begin with a volume's mesh, and what stays of it; facets are looked up about slivers alone."""
        self._stays, self._short_m = stays, short_m
        self._fixed = np.zeros(len(volume.vertices), bool)
        self._fixed[volume.faces[kept]] = True
        self.vertices, self.faces = volume.vertices.copy(), volume.faces.copy()
        self.source, self.label = volume.source.copy(), volume.label.copy()
        self.alive = np.ones(len(self.faces), bool)
        # Vertices of facets that changed since all slivers were last tried: what failed elsewhere would fail again.
        self._changed = {"edge": np.ones(len(self.vertices), bool), "facet": np.ones(len(self.vertices), bool)}
        self._at: dict[int, set[int]] = {}
        order = np.argsort(self.faces.ravel(), kind="stable")
        self._order = order // 3
        self._starts = np.searchsorted(self.faces.ravel()[order], np.arange(len(self.vertices) + 1))

    def collapse(self) -> int:
        """Make one vertex of each short edge; return of how many."""
        count = 0
        edges = self._edges(self._take_changed("edge"))
        length = np.linalg.norm(self.vertices[edges[:, 0]] - self.vertices[edges[:, 1]], axis=1)
        short = np.flatnonzero(length < self._short_m)
        for u, v in edges[short[np.argsort(length[short], kind="stable")]].tolist():
            count += self._collapse(u, v)
        return count

    def flip(self) -> int:
        """Give the longest edges of low facets to the facets beyond; return how many."""
        some = np.flatnonzero(self.alive & self._take_changed("facet")[self.faces].any(axis=1))
        corners = self.vertices[self.faces[some]]
        sides = np.linalg.norm(corners.take(_NEXT, 1) - corners, axis=2)
        double = np.linalg.norm(_normals(corners), axis=1)
        low = (double < self._short_m * sides.max(axis=1)) & (sides.min(axis=1) >= self._short_m)
        return sum(self._flip(k) for k in some[low].tolist())

    def _take_changed(self, kind: str) -> np.ndarray:
        """Return about which vertices (v,) edges or facets are to be tried, which from now on they are."""
        found = self._changed[kind]
        self._changed[kind] = np.zeros(len(self.vertices), bool)
        return found

    def _note_changed(self, facets: list[int]) -> None:
        for changed in self._changed.values():
            changed[self.faces[facets]] = True

    def _edges(self, changed: np.ndarray) -> np.ndarray:
        """Return the edges (n, 2) from or to some vertices (v,)."""
        faces = self.faces[self.alive]
        faces = faces[changed[faces].any(axis=1)]
        edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        found: np.ndarray = edges[(edges[:, 0] < edges[:, 1]) & changed[edges].any(axis=1)]
        return found

    def _around(self, vertex: int) -> set[int]:
        """Return the facets at a vertex."""
        if vertex not in self._at:
            self._at[vertex] = set(self._order[self._starts[vertex] : self._starts[vertex + 1]].tolist())
        return self._at[vertex]

    def _neighbours(self, vertex: int) -> set[int]:
        return {k for facet in self._around(vertex) for k in self.faces[facet].tolist()} - {vertex}

    def _collapse(self, u: int, v: int) -> bool:
        """Collapse an edge if both its ends have just two neighbours in common and no facet turns over."""
        if self._fixed[u] or self._fixed[v] or self._stays[u] or self._stays[v]:
            return False
        gone = self._around(u) & self._around(v)
        shared = self._neighbours(u) & self._neighbours(v)
        if len(gone) != 2 or len(shared) != 2 or np.linalg.norm(self.vertices[u] - self.vertices[v]) >= self._short_m:
            return False
        kept = np.array(sorted((self._around(u) | self._around(v)) - gone))
        for place in ((self.vertices[u] + self.vertices[v]) / 2, self.vertices[u], self.vertices[v]):
            moved = self.vertices[self.faces[kept]]
            moved[(self.faces[kept] == u) | (self.faces[kept] == v)] = place
            if not self._turns(kept, moved):
                break
        else:
            return False
        self._note_changed([*gone, *kept.tolist()])
        for k in gone:
            for corner in self.faces[k].tolist():
                self._around(corner).discard(k)
        self.alive[list(gone)] = False
        self.vertices[u] = place
        for k in self._around(v):
            self.faces[k][self.faces[k] == v] = u
        self._around(u).update(self._around(v))
        self._at[v] = set()
        return True

    def _turns(self, facets: np.ndarray, moved: np.ndarray) -> bool:
        """Return whether one of some facets that have an area turns over with its corners (n, 3, 3)."""
        corners = self.vertices[self.faces[facets]]
        old, new = _normals(corners), _normals(moved)
        sizes = np.linalg.norm(old, axis=1), np.linalg.norm(new, axis=1)
        longest = np.linalg.norm(corners.take(_NEXT, 1) - corners, axis=2).max(axis=1)
        real = sizes[0] > self._short_m * longest
        return bool((np.sum(old * new, axis=1) < _TURN * sizes[0] * sizes[1])[real].any())

    def _flip(self, facet: int) -> bool:
        """Flip a facet's longest edge if the lower of both facets gets higher, none turns over and the edge is new."""
        if not self.alive[facet] or self._fixed[self.faces[facet]].any():
            return False
        face = self.faces[facet].tolist()
        sides = [float(np.linalg.norm(self.vertices[face[i]] - self.vertices[face[i - 2]])) for i in range(3)]
        i = int(np.argmax(sides))
        a, b, c = face[i], face[i - 2], face[i - 1]
        beyond = (self._around(a) & self._around(b)) - {facet}
        if len(beyond) != 1:
            return False
        (other,) = beyond
        d = next(k for k in self.faces[other].tolist() if k not in (a, b))
        if d == c or d in self._neighbours(c):
            return False
        new = [[a, d, c], [d, b, c]]
        corners = self.vertices[[*new, face, self.faces[other].tolist()]]
        normals = _normals(corners)
        sizes = np.linalg.norm(normals, axis=1)
        heights = sizes / np.maximum(np.linalg.norm(corners.take(_NEXT, 1) - corners, axis=2).max(axis=1), 1e-30)
        if heights[:2].min() <= heights[2:].min():  # or slivers beside each other are flipped to and fro
            return False
        if (normals[:2] @ normals[3] < _TURN * sizes[:2] * np.linalg.norm(normals[3])).any():
            return False
        self._note_changed([facet, other])
        self._around(b).discard(facet)
        self._around(a).discard(other)
        self.faces[facet], self.faces[other] = new
        self._around(d).add(facet)
        self._around(c).add(other)
        self.source[facet], self.label[facet] = self.source[other], self.label[other]
        return True


def _normals(corners: np.ndarray) -> np.ndarray:
    """Return twice the area times the normal (n, 3) of triangles (n, 3, 3); `np.cross` is slow for a few of them."""
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    found: np.ndarray = one.take(_NEXT, 1) * two.take(_LAST, 1) - one.take(_LAST, 1) * two.take(_NEXT, 1)
    return found
