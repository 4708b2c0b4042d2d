"""Facets of one plane as convex polygons, and the ways from their corners into the rock."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.volume.mesh_edges import MeshEdges
from pipeline.volume.union import Volume

_LONGEST = 2.0  # of a corner's way into the rock, in depths: at sharp edges the corner stays nearer
_FLAT = 1e-6  # m, of the corners of one polygon from its plane
_PARALLEL = 1e-9  # of the cosine between facets of one plane
_OF_EACH = 5e-6  # m, of all corners from the plane of each of its facets: the certificate takes 1e-5
_STRAIGHT = 1e-9  # of the sine at a corner of a convex polygon
_RIDGE = 1e-3


class FacetPlanes:
    """The planes of a volume's facets, and what is about its vertices.

    Attributes
    ----------
    size : (f,) float64, m2
        Twice the area of each facet.
    unit : (f, 3) float64
        Its normal, out of the free space.
    edges : MeshEdges
    level_m : (f,) float64, m
        Where the plane is along its normal.
    ways : (v, 3) float64
        As of `ways_into_rock`.
    """

    def __init__(self, volume: Volume) -> None:
        """Take all facets."""
        self.volume = volume
        self.size = np.linalg.norm(volume.normals, axis=1)
        self.unit = volume.normals / np.maximum(self.size, 1e-30)[:, None]
        self.edges = MeshEdges.of(volume)
        self.level_m = np.einsum("ij,ij->i", self.unit, volume.vertices[volume.faces[:, 0]])
        self.ways = ways_into_rock(volume, self.unit)

    @cached_property
    def flat(self) -> np.ndarray:
        """Return across which sides (f, 3) facets have one of about the same plane, and of their label."""
        faces, label = self.volume.faces, self.volume.label
        beside = self.edges.facets(np.roll(faces, -1, axis=1), faces)
        found: np.ndarray = np.einsum("fx,fix->fi", self.unit, self.unit[beside]) > 1 - 2 * _PARALLEL
        found &= label[:, None] == label[beside]
        return found

    def flat_groups(self) -> np.ndarray:
        """Return a number (f,) for each facet, the same for those that flat sides join."""
        faces, n = self.volume.faces, len(self.volume.faces)
        facet, side = np.nonzero(self.flat)
        other = self.edges.facets(faces[facet, (side + 1) % 3], faces[facet, side])
        found: np.ndarray = connected_components(coo_matrix((np.ones(len(facet)), (facet, other)), (n, n)))[1]
        return found


def polygons_of(planes: FacetPlanes, some: np.ndarray | None = None) -> list[tuple[list[int], list[int]]]:
    """Return convex polygons of coplanar facets with one label: their vertices in order, and their facets.

    `some` (n,) are the facets of some groups, in order; otherwise all are taken.
    """
    volume = planes.volume
    if some is None:
        some = np.arange(len(volume.faces))
    numbers, some_faces = some.tolist(), volume.faces[some]
    faces = dict(zip(numbers, some_faces.tolist(), strict=True))
    ring, held = dict(faces), {k: [k] for k in numbers}
    owner = {(face[i], face[(i + 1) % 3]): k for k, face in faces.items() for i in range(3)}
    vertices = np.unique(some_faces)
    places = dict(zip(vertices.tolist(), map(tuple, volume.vertices[vertices].tolist()), strict=True))
    units = dict(zip(numbers, map(tuple, planes.unit[some].tolist()), strict=True))
    offset = dict(zip(numbers, planes.level_m[some].tolist(), strict=True))
    row, sides = np.nonzero(planes.flat[some])
    for facet, side in zip(some[row].tolist(), sides.tolist(), strict=True):
        a, b = faces[facet][side], faces[facet][(side + 1) % 3]
        one, two = owner.get((a, b), -1), owner.get((b, a), -1)
        if one == two or _dot(units[one], units[two]) < 1 - _PARALLEL:
            continue
        if max(abs(_dot(places[v], units[one]) - offset[one]) for v in ring[two]) > _FLAT:
            continue
        joined = _spliced(ring[one], ring[two], a, b)
        if joined is None or not _is_convex([places[v] for v in joined], units[one]):
            continue
        facets = held[one] + held[two]  # the plane of a narrow facet may be far off beyond it
        if np.abs(volume.vertices[joined] @ planes.unit[facets].T - planes.level_m[facets]).max() > _OF_EACH:
            continue
        ring[one] = joined
        held[one] += held.pop(two)
        for i, v in enumerate(ring[two]):
            owner[v, ring[two][(i + 1) % len(ring[two])]] = one
        del ring[two]
        owner[a, b] = owner[b, a] = one
    return [(ring[k], held[k]) for k in ring]


def _spliced(one: list[int], two: list[int], a: int, b: int) -> list[int] | None:
    """Return the ring of two polygons that share the edge from a to b; None if they share more corners."""
    i, j = one.index(a), two.index(b)
    first = one[i + 1 :] + one[: i + 1]  # begins at b, ends at a
    second = two[j + 1 :] + two[: j + 1]  # begins at a, ends at b
    joined = first + second[1:-1]
    return joined if len(set(joined)) == len(joined) else None


def _is_convex(corners: list[tuple[float, ...]], normal: tuple[float, ...]) -> bool:
    """Return whether a ring turns left alone about its normal, and nowhere back. It is short: NumPy is slower."""
    edges = []
    for (x, y, z), (u, v, w) in zip(corners[-1:] + corners[:-1], corners, strict=True):
        size = max(math.hypot(u - x, v - y, w - z), 1e-30)
        edges.append(((u - x) / size, (v - y) / size, (w - z) / size))
    for last, edge in zip(edges, edges[1:] + edges[:1], strict=True):
        (x, y, z), (u, v, w) = last, edge
        if _dot((y * w - z * v, z * u - x * w, x * v - y * u), normal) <= -_STRAIGHT or _dot(last, edge) <= -0.999:
            return False
    return True


def _dot(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def ways_into_rock(volume: Volume, unit: np.ndarray) -> np.ndarray:
    """Return for each vertex the vector (v, 3) that goes one metre behind each of its facets, as near as can be.

    `unit` (f, 3) are the facets' normals.
    """
    corners = volume.vertices[volume.faces]
    to_next = np.roll(corners, -1, axis=1) - corners
    to_last = np.roll(corners, 1, axis=1) - corners
    cosine = np.einsum("ijk,ijk->ij", to_next, to_last)
    cosine /= np.maximum(np.linalg.norm(to_next, axis=2) * np.linalg.norm(to_last, axis=2), 1e-30)
    angle = np.arccos(np.clip(cosine, -1, 1))
    n = len(volume.vertices)
    squares, sums = np.zeros((n, 3, 3)), np.zeros((n, 3))
    outer = unit[:, :, None] * unit[:, None, :]
    for i in range(3):
        np.add.at(squares, volume.faces[:, i], angle[:, i, None, None] * outer)
        np.add.at(sums, volume.faces[:, i], angle[:, i, None] * unit)
    squares += _RIDGE * np.eye(3)
    way: np.ndarray = np.linalg.solve(squares, sums[:, :, None])[:, :, 0]
    length = np.linalg.norm(way, axis=1, keepdims=True)
    return way * np.minimum(1.0, _LONGEST / np.maximum(length, 1e-9))
