"""A mesh whose plumb ledges are cut at the places of their corners."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.volume.folded.mesh_cuts import MeshCuts
from pipeline.volume.union import Volume

_PLUMB = 0.02  # of a facet's normal: so steep a ledge has no area seen from above
_ONE_PLACE_M = 1e-3  # seen from above: corners that are nearer get one height


def cut_ledges(volume: Volume, is_ledge: np.ndarray) -> tuple[Volume, np.ndarray, np.ndarray]:
    """Return the mesh with cut ledges, the first (v,) of the corners over each other, and each facet's parent (f,)."""
    normal = volume.normals
    plumb = is_ledge & (np.abs(normal[:, 2]) < _PLUMB * np.linalg.norm(normal, axis=1))
    uncut = _uncut(volume, plumb)
    mesh = MeshCuts(volume, _joined(volume, plumb, uncut))
    for facet in uncut.tolist():
        _part(mesh, plumb, facet)
    vertices, faces, parent = mesh.mesh()
    cut = replace(volume, vertices=vertices, faces=faces, source=volume.source[parent], label=volume.label[parent])
    a, b = (np.concatenate([faces[plumb[parent]][:, k] for k in order]) for order in ((0, 1, 2), (1, 2, 0)))
    over = np.linalg.norm((vertices[a] - vertices[b])[:, :2], axis=1) < _ONE_PLACE_M
    n = len(vertices)
    _, group = connected_components(coo_matrix((np.ones(over.sum()), (a[over], b[over])), (n, n)), directed=False)
    _, first = np.unique(group, return_index=True)
    return cut, first[group], parent


def _uncut(volume: Volume, plumb: np.ndarray) -> np.ndarray:
    """Return the plumb facets (n,) whose middle corner is to be cut at; `_part` tries them again."""
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


def _part(mesh: MeshCuts, plumb: np.ndarray, facet: int) -> None:
    """Part a plumb facet, and what comes of it, until each has two corners over each other."""
    stack = [facet]
    while stack:
        face = mesh.corners[stack.pop()]
        places = [mesh.place(k) for k in face]
        length = [hypot(p[0] - q[0], p[1] - q[1]) for p, q in zip(places, places[1:] + places[:1], strict=True)]
        if min(length) < _ONE_PLACE_M:
            continue
        i = length.index(max(length))
        (x, y, z), (u, v, w), (s, t, _) = places[i], places[i - 2], places[i - 1]
        share = ((s - x) * (u - x) + (t - y) * (v - y)) / length[i] ** 2
        if not _ONE_PLACE_M < share * length[i] < length[i] - _ONE_PLACE_M:
            continue
        halves = mesh.part_edge(face[i], face[i - 2], [s, t, (1 - share) * z + share * w])
        stack += [half for half in halves if plumb[mesh.parent(half)]]
