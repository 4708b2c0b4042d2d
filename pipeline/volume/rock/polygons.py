"""Facets of one plane as convex polygons, and the ways from their corners into the rock."""

from __future__ import annotations

import math

import numpy as np

from pipeline.volume.mesh_edges import MeshEdges
from pipeline.volume.union import Volume

# Of a part along an axis: MuJoCo keeps its corners in 32 bits about its middle, and so within 0.01 mm:
# findings/mujoco-mesh-corners-of-32-bits.sh.
LONGEST_M = 100.0
_LONGEST = 2.0  # of a corner's way into the rock, in depths: at sharp edges the corner stays nearer
_FLAT = 1e-6  # m, of the corners of one polygon from its plane
_PARALLEL = 1e-9  # of the cosine between facets of one plane
_OF_EACH = 5e-6  # m, of all corners from the plane of each of its facets: the certificate takes 1e-5
_STRAIGHT = 1e-9  # of the sine at a corner of a convex polygon
_RIDGE = 1e-3


def polygons_of(volume: Volume) -> list[tuple[list[int], list[int]]]:
    """Return convex polygons of coplanar facets with one label, up to 100 m long: vertices in order, and facets."""
    normal = volume.normals
    unit = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    beside = MeshEdges.of(volume).facets(np.roll(volume.faces, -1, axis=1), volume.faces)
    flat = np.einsum("fx,fix->fi", unit, unit[beside]) > 1 - 2 * _PARALLEL
    flat &= volume.label[:, None] == volume.label[beside]
    facet, side = np.nonzero(flat)
    level = np.einsum("ij,ij->i", unit, volume.vertices[volume.faces[:, 0]])

    is_joined = flat.any(axis=1)
    found = _joined(volume, unit, level, np.flatnonzero(is_joined), np.column_stack([facet, side]))
    alone = np.flatnonzero(~is_joined)
    found += [(face, [k]) for face, k in zip(volume.faces[alone].tolist(), alone.tolist(), strict=True)]
    return sorted(found, key=lambda polygon: polygon[1][0])


def _joined(
    volume: Volume, unit: np.ndarray, level: np.ndarray, facets: np.ndarray, joints: np.ndarray
) -> list[tuple[list[int], list[int]]]:
    """Return polygons of some facets (n,), joined across edges where that is possible.

    `unit` (f, 3) and `level` (f,) m are the planes of all facets; `joints` (k, 2) are facets and the number of their
    edge.
    """
    faces = dict(zip(facets.tolist(), volume.faces[facets].tolist(), strict=True))
    ring, held = dict(faces), {k: [k] for k in faces}
    owner = {(face[i], face[(i + 1) % 3]): k for k, face in faces.items() for i in range(3)}
    corners = np.unique(volume.faces[facets])
    places = dict(zip(corners.tolist(), map(tuple, volume.vertices[corners].tolist()), strict=True))
    units = dict(zip(faces, map(tuple, unit[facets].tolist()), strict=True))
    offset = dict(zip(faces, level[facets].tolist(), strict=True))
    for facet, side in joints.tolist():
        a, b = faces[facet][side], faces[facet][(side + 1) % 3]
        one, two = owner[a, b], owner[b, a]
        if one == two or _dot(units[one], units[two]) < 1 - _PARALLEL:
            continue
        if max(abs(_dot(places[v], units[one]) - offset[one]) for v in ring[two]) > _FLAT:
            continue
        joined = _spliced(ring[one], ring[two], a, b)
        if joined is None or not _is_convex([places[v] for v in joined], units[one]):
            continue
        both = held[one] + held[two]  # the plane of a narrow facet may be far off beyond it
        at = volume.vertices[joined]
        if np.ptp(at, axis=0).max() > LONGEST_M or np.abs(at @ unit[both].T - level[both]).max() > _OF_EACH:
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
    last, first = None, (0.0, 0.0, 0.0)
    x, y, z = corners[-1]
    for u, v, w in corners:
        size = max(math.hypot(u - x, v - y, w - z), 1e-30)
        edge = (u - x) / size, (v - y) / size, (w - z) / size
        if last is None:
            first = edge
        elif not _turns_left(last, edge, normal):
            return False
        last, x, y, z = edge, u, v, w
    return last is not None and _turns_left(last, first, normal)


def _turns_left(one: tuple[float, ...], two: tuple[float, ...], normal: tuple[float, ...]) -> bool:
    """Return whether unit vector `two` goes left of `one` about a normal, or as good as straight on."""
    (x, y, z), (u, v, w) = one, two
    return _dot((y * w - z * v, z * u - x * w, x * v - y * u), normal) > -_STRAIGHT and _dot(one, two) > -0.999


def _dot(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def ways_into_rock(volume: Volume) -> np.ndarray:
    """Return for each vertex the vector (v, 3) that goes one metre behind each of its facets, as near as can be."""
    normal = volume.normals
    unit = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
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
