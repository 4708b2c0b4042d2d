"""Facets of one plane as convex polygons, and the ways from their corners into the rock."""

from __future__ import annotations

import numpy as np

from pipeline.volume.union import Volume

_LONGEST = 2.0  # of a corner's way into the rock, in depths: at sharp edges the corner stays nearer
_FLAT = 1e-6  # m, of the corners of one polygon from its plane
_OF_EACH = 5e-6  # m, of all corners from the plane of each of its facets: the certificate takes 1e-5
_STRAIGHT = 1e-9  # of the sine at a corner of a convex polygon
_RIDGE = 1e-3


def polygons_of(volume: Volume) -> list[tuple[list[int], list[int]]]:
    """Return convex polygons of coplanar facets with one label: their vertices in order, and their facets."""
    normal = volume.normals
    unit = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    ring = {k: face for k, face in enumerate(volume.faces.tolist())}
    held = {k: [k] for k in ring}
    owner = {(face[i], face[(i + 1) % 3]): k for k, face in ring.items() for i in range(3)}
    vertices, label = volume.vertices, volume.label
    offset = np.einsum("ij,ij->i", unit, vertices[volume.faces[:, 0]])
    for (a, b), first in list(owner.items()):
        one, two = owner[a, b], owner.get((b, a), -1)
        if two < 0 or one == two or label[one] != label[two] or unit[one] @ unit[two] < 1 - 1e-9:
            continue
        if np.abs(vertices[ring[two]] @ unit[one] - offset[one]).max() > _FLAT:
            continue
        joined = _spliced(ring[one], ring[two], a, b)
        if joined is not None:
            facets = held[one] + held[two]  # the plane of a narrow facet may be far off beyond it
            if np.abs(vertices[joined] @ unit[facets].T - offset[facets]).max() > _OF_EACH:
                continue
        if joined is None or not _is_convex(vertices[joined], unit[one]):
            continue
        ring[one] = joined
        held[one] += held.pop(two)
        for i, p in enumerate(ring[two]):
            owner[p, ring[two][(i + 1) % len(ring[two])]] = one
        del ring[two], owner[a, b], owner[b, a], first
        owner[a, b] = owner[b, a] = one
    return [(ring[k], held[k]) for k in ring]


def _spliced(one: list[int], two: list[int], a: int, b: int) -> list[int] | None:
    """Return the ring of two polygons that share the edge from a to b; None if they share more corners."""
    i, j = one.index(a), two.index(b)
    first = one[i + 1 :] + one[: i + 1]  # begins at b, ends at a
    second = two[j + 1 :] + two[: j + 1]  # begins at a, ends at b
    joined = first + second[1:-1]
    return joined if len(set(joined)) == len(joined) else None


def _is_convex(corners: np.ndarray, normal: np.ndarray) -> bool:
    edge = np.roll(corners, -1, axis=0) - corners
    edge /= np.maximum(np.linalg.norm(edge, axis=1, keepdims=True), 1e-30)
    turn = np.cross(np.roll(edge, 1, axis=0), edge) @ normal
    return bool((turn > -_STRAIGHT).all() and (np.einsum("ij,ij->i", np.roll(edge, 1, axis=0), edge) > -0.999).all())


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
