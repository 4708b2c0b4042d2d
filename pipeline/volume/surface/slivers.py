"""Slivers of a closed mesh: facets that are hardly any higher than a rounding, which relief would turn over."""

from __future__ import annotations

import numpy as np

_THIN_M = 2e-3  # of a sliver's height
_SHORT_M = 0.1  # of the edge that is folded to a point
_EVEN_M = 1e-3  # of the floors' border
_FRONT = 0.5  # cosine of the widest turn of a facet beside


def without_slivers(vertices: np.ndarray, faces: np.ndarray, of_floor: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return faces (m, 3) of a closed mesh and which are floors (m,), with the shortest edges of slivers folded.

    An edge is folded to one of its ends if the mesh stays closed, no facet that is not a sliver turns, and the border
    of the floors stays where it is.
    """
    faces, kept = faces.copy(), np.ones(len(faces), bool)
    for face in np.flatnonzero(_heights(vertices, faces) < _THIN_M).tolist():
        if kept[face]:
            ends = _shortest_edge(vertices, faces[face])
            for gone, stays in (ends, ends[::-1]):
                short = np.linalg.norm(vertices[gone] - vertices[stays]) < _SHORT_M
                even = short and _keeps_border(vertices, faces[kept], of_floor[kept], gone, stays)
                if even and _folds(vertices, faces, kept, gone, stays):
                    kept &= ~((faces == gone).any(axis=1) & (faces == stays).any(axis=1))
                    faces[faces == gone] = stays
                    break
    return faces[kept], of_floor[kept]


def _keeps_border(vertices: np.ndarray, faces: np.ndarray, of_floor: np.ndarray, gone: int, stays: int) -> bool:
    """Return whether a vertex lies on the floors' border as it is when the vertex is merged into another."""
    about = (faces == gone).any(axis=1)
    on_floor, on_rock = (np.unique(faces[about & side]) for side in (of_floor, ~of_floor))
    far = np.setdiff1d(np.intersect1d(on_floor, on_rock), [gone, stays])  # ends of the border's edges, and a few more
    along = vertices[far] - vertices[stays]
    off = np.linalg.norm(np.cross(along, vertices[gone] - vertices[stays]), axis=1)
    return bool((off <= _EVEN_M * np.linalg.norm(along, axis=1)).all())


def _heights(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the least heights (m,) m of facets."""
    corners = vertices[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    double = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    found: np.ndarray = double / np.maximum(longest, 1e-30)
    return found


def _shortest_edge(vertices: np.ndarray, face: np.ndarray) -> tuple[int, int]:
    ends = [(int(face[k]), int(face[(k + 1) % 3])) for k in range(3)]
    return min(ends, key=lambda pair: float(np.linalg.norm(vertices[pair[0]] - vertices[pair[1]])))


def _folds(vertices: np.ndarray, faces: np.ndarray, kept: np.ndarray, gone: int, stays: int) -> bool:
    """Return whether a vertex may be merged into another: they share two neighbours, and no facet turns."""
    about = np.flatnonzero(kept & (faces == gone).any(axis=1))
    other = np.flatnonzero(kept & (faces == stays).any(axis=1))
    shared = np.intersect1d(np.unique(faces[about]), np.unique(faces[other]))
    if len(shared) != 4:  # the two and their neighbours
        return False
    moving = faces[np.setdiff1d(about, other)]
    moved = np.where(moving == gone, stays, moving)
    real = _heights(vertices, moving) >= _THIN_M
    before, after = (_normals(vertices, one[real]) for one in (moving, moved))
    return bool((np.einsum("ij,ij->i", before, after) > _FRONT).all())


def _normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    cross = np.cross(b - a, c - a)
    found: np.ndarray = cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-30)
    return found
