"""Closed meshes that do not cross themselves: folds of scanned ones are smoothed until their facets lie apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_array

from pipeline.errors import GeometryError
from pipeline.volume.crossings import CROSSING_M, crossing_facets

_STEP = 0.5  # of the way from a corner to the mean of its neighbours in a round
_WIDER = 3  # rounds after which corners one edge farther away move too
_ROUNDS = 60


@dataclass(frozen=True)
class UncrossedMesh:
    """A mesh (n, 3) m, (m, 3), how many facets crossed, and by how much, m, the farthest of its corners was moved."""

    vertices: np.ndarray
    faces: np.ndarray
    crossed: int
    moved_m: float


def uncrossed(vertices: np.ndarray, faces: np.ndarray) -> UncrossedMesh:
    """Return a mesh whose facets do not cross: corners of those that do move towards their neighbours.

    A fold that stays takes its neighbours along, and theirs. Other corners keep their places.

    Parameters
    ----------
    vertices, faces : (n, 3) float64 m, (m, 3) int
        Closed.

    Raises
    ------
    GeometryError
        If facets still cross after 60 rounds. The message names the place.
    """
    pairs = crossing_facets(vertices, faces, CROSSING_M)
    crossed, moved = len(np.unique(pairs)), vertices.copy()
    nearby = _neighbours(faces, len(vertices))
    for n in range(_ROUNDS):
        if not len(pairs):
            far = np.linalg.norm(moved - vertices, axis=1).max(initial=0.0)
            return UncrossedMesh(moved, faces, crossed, float(far))
        corners = np.zeros(len(vertices), bool)
        corners[faces[np.unique(pairs)]] = True
        for _ in range(n // _WIDER):
            corners |= nearby @ corners > 0
        moved[corners] += _STEP * (nearby[corners] @ moved - moved[corners])
        pairs = crossing_facets(moved, faces, CROSSING_M, corners[faces].any(axis=1))
    x, y, z = moved[faces[pairs[0, 0]]].mean(axis=0)
    raise GeometryError(
        f"its surface crosses itself at ({x:.1f}, {y:.1f}, {z:.1f}) m; --voxel M finds it at another resolution"
    )


def _neighbours(faces: np.ndarray, count: int) -> csr_array:
    """Return a matrix (count, count) by which corners become the means of those at the other ends of their edges."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    ends = np.unique(np.concatenate([ends, ends[:, ::-1]]), axis=0)
    share = 1 / np.bincount(ends[:, 0], minlength=count)[ends[:, 0]]
    return csr_array(coo_matrix((share, ends.T), (count, count)))
