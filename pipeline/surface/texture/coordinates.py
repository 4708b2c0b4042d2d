"""Texture coordinates that follow the rock: texels keep their size on faces that stand out of the wall."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.linalg import cg

_LEAST = 0.35  # of an axis' length on a face; on faces that turn more than 70 deg from it its direction is uncertain
_ACCURACY, _ROUNDS = 1e-4, 2000  # of the solution, relative; far fewer rounds are needed
_SLIVER_M2 = 1e-10


def relax_texture(
    vertices: np.ndarray, faces: np.ndarray, laid_m: np.ndarray, axes: np.ndarray, tether_m: float
) -> np.ndarray:
    """Return what to add to texture coordinates laid on the plan's walls so that they follow the displaced surface.

    A texture laid along a wall stretches by 1 / cos of the angle between wall and face. This minimises, for each of
    the two coordinates w, the integral over the surface of |grad w - t|^2 + (offset / tether)^2. t is the unit vector
    on the face along the texture's axis, so that w grows by a metre in a metre of rock. The second term keeps the
    texture within about a tether's length of the plan's.

    Parameters
    ----------
    vertices : (n, 3), m
    faces : (m, 3) int
    laid_m : (m, 3, 2)
        Texture coordinates of the faces' corners, m; corners and not vertices, since a texture has seams.
    axes : (m, 2, 3)
        The texture's two axes at each face: unit vectors.
    tether_m : float

    Returns
    -------
    (n, 2) float64, m
        Equal on both sides of a seam. Vertices without a face have 0.

    References
    ----------
    Levy et al. 2002, ACM Trans. Graph. 21(3), doi:10.1145/566654.566590 (least squares on triangles)
    """
    normal, area, gradient = _gradients(vertices[faces])
    index = faces.astype(np.int32)
    mass = np.bincount(index.ravel(), np.repeat(area / 3, 3), len(vertices)) / tether_m**2
    mass[mass == 0] = 1.0  # a vertex without a face
    matrix = (_stiffness(index, area, gradient, len(vertices)) + diags_array(mass)).tocsr()
    inverse = diags_array(1.0 / matrix.diagonal())
    offsets = []
    for k in (0, 1):
        along = axes[:, k] - (axes[:, k] * normal).sum(axis=1, keepdims=True) * normal
        wanted = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), _LEAST)
        missing = wanted - np.einsum("fi,fid->fd", laid_m[:, :, k], gradient)
        push = area[:, None] * np.einsum("fid,fd->fi", gradient, missing)
        right = np.bincount(index.ravel(), push.ravel(), len(vertices))
        offsets.append(cg(matrix, right, rtol=_ACCURACY, maxiter=_ROUNDS, M=inverse)[0])
    return np.column_stack(offsets)


def _gradients(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return faces' normals (m, 3), areas (m,) m2, and gradients (m, 3, 3) 1/m of what is 1 at one corner, else 0."""
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double = np.maximum(np.linalg.norm(cross, axis=1), _SLIVER_M2)
    normal = cross / double[:, None]
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    return normal, double / 2, np.cross(normal[:, None], opposite) / double[:, None, None]


def _stiffness(faces: np.ndarray, area: np.ndarray, gradient: np.ndarray, count: int) -> csr_array:
    """Return the matrix (count, count) of the integral of |grad w|^2, by areas (m,) and gradients (m, 3, 3)."""
    products = area[:, None, None] * np.einsum("fid,fjd->fij", gradient, gradient)
    places = np.repeat(faces, 3, axis=1).ravel(), np.tile(faces, (1, 3)).ravel()
    return coo_array((products.ravel(), places), shape=(count, count)).tocsr()
