"""Polygons of meshes cut into triangles: fans where they are convex, by ears where they are not."""

from __future__ import annotations

import numpy as np

_LEAST_M2 = 1e-12  # twice a triangle's area
_FLAT = 1e-9  # of the square of a polygon's size: a corner that turns by less is on a straight line


def triangles_of(vertices: np.ndarray, corners: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Return polygons as triangles (m, 3), in the polygons' order and sense.

    A fan from the first corner of a polygon that is not convex folds over, and one with three corners on a line has a
    triangle without an area.

    Parameters
    ----------
    vertices : (n, 3) float64
    corners : (k,) int64
        The vertices of the polygons, one after the other.
    sizes : (p,) int64
        How many corners each has; those with less than three are left out.
    """
    first = np.cumsum(sizes) - sizes
    is_folded = np.isin(np.arange(len(sizes)), _folded(vertices, corners, sizes))
    parts, order = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    for size in np.unique(sizes[sizes > 2]):
        rows = np.flatnonzero((sizes == size) & ~is_folded)
        fans = np.column_stack([np.zeros(size - 2, int), np.arange(1, size - 1), np.arange(2, size)])
        parts.append(corners[first[rows, None] + np.arange(size)][:, fans].reshape(-1, 3))
        order.append(np.repeat(rows, size - 2))
    for row in np.flatnonzero(is_folded):
        polygon = corners[first[row] : first[row] + sizes[row]]
        ears = polygon[cut_by_ears(vertices[polygon])]
        parts.append(ears)
        order.append(np.repeat(row, len(ears)))
    return np.concatenate(parts)[np.argsort(np.concatenate(order), kind="stable")]


def _is_convex(polygons: np.ndarray) -> np.ndarray:
    """Return which polygons (p, k, 3) turn one way at every corner, seen along their normals."""
    sides = np.roll(polygons, -1, axis=1) - polygons
    turns = np.cross(np.roll(sides, 1, axis=1), sides)
    normals = np.cross(polygons - polygons[:, :1], np.roll(polygons, -1, axis=1) - polygons[:, :1]).sum(axis=1)
    lengths = np.linalg.norm(normals, axis=1)
    along = np.einsum("pkc,pc->pk", turns, normals / np.maximum(lengths, np.finfo(float).tiny)[:, None])
    return np.asarray((along > _FLAT * (sides**2).sum(axis=(1, 2))[:, None]).all(axis=1))


def cut_by_ears(corners: np.ndarray) -> np.ndarray:
    """Return triangles (k - 2, 3) of a ring (k, 3), counter-clockwise about it as it is seen along its normal."""
    import manifold3d  # few scans are meshes

    middle = corners - corners.mean(axis=0)
    normal = np.cross(middle, np.roll(middle, -1, axis=0)).sum(axis=0)
    size = float(np.linalg.norm(normal))
    k = len(corners)
    if k == 3 or size < _LEAST_M2:
        return np.column_stack([np.zeros(k - 2, int), np.arange(1, k - 1), np.arange(2, k)])
    aside = np.linalg.svd(normal[None] / size)[2][1:]
    if np.cross(*aside) @ normal < 0:
        aside = aside[::-1]
    return np.asarray(manifold3d.triangulate([middle @ aside.T]), np.int64).reshape(-1, 3)


def with_triangles(data: bytes) -> bytes:
    """Return an OBJ file with its polygons that are not convex as triangles, so that no reader makes fans of them.

    All other lines stay. What cannot be read stays too: the reader refuses it.
    """
    lines = data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines()
    places, numbers, corners, sizes = list[list[bytes]](), list[int](), list[int](), list[int]()
    try:
        for number, line in enumerate(lines):
            match line.split():
                case [b"v", *place]:
                    places.append(place[:3])
                case [b"f", _, _, _, _, *_] as words:
                    named = [int(word.split(b"/")[0]) for word in words[1:]]
                    numbers.append(number)
                    sizes.append(len(named))
                    corners += [k - 1 if k > 0 else len(places) + k for k in named]
        if not sizes or not 0 <= min(corners) <= max(corners) < len(places):
            return data
        vertices = np.array(places, float).reshape(-1, 3)
    except ValueError:
        return data
    flat, counts = np.array(corners), np.array(sizes)
    first = np.cumsum(counts) - counts
    for k in _folded(vertices, flat, counts):
        words = lines[numbers[k]].split()[1:]
        ears = cut_by_ears(vertices[flat[first[k] : first[k] + counts[k]]])
        lines[numbers[k]] = b"\n".join(b"f " + b" ".join(words[corner] for corner in ear) for ear in ears)
    return b"\n".join(lines) + b"\n"


def _folded(vertices: np.ndarray, corners: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Return the numbers of the polygons that are not convex."""
    first = np.cumsum(sizes) - sizes
    found = [np.zeros(0, np.int64)]
    for size in np.unique(sizes[sizes > 3]):
        rows = np.flatnonzero(sizes == size)
        found.append(rows[~_is_convex(vertices[corners[first[rows, None] + np.arange(size)]])])
    return np.sort(np.concatenate(found))
