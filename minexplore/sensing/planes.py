"""Distances of hits in double precision, from the planes of the faces that were hit.

Ray casters of 32 bits divide by approximations, which differ between makers of processors. Which face a ray hits is
the same on all of them but for ties; its distance is made again here, by operations that IEEE 754 defines exactly.
"""

from __future__ import annotations

import numpy as np

_CAST_M = 1e-3  # a ray caster of 32 bits is never farther off, but where a ray grazes a face


def face_planes(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return planes (n, 4), normal of any length and offset m, of the faces (n, 3) of vertices (k, 3) m."""
    one, two, three = (vertices[faces[:, k]].astype(np.float64) for k in range(3))
    (ax, ay, az), (bx, by, bz) = (two - one).T, (three - one).T
    planes = np.empty((len(faces), 4))
    planes[:, 0], planes[:, 1], planes[:, 2] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    planes[:, 3] = _dot(planes, one)
    return planes


@np.errstate(divide="ignore", invalid="ignore", over="ignore")
def plane_distances(
    planes: np.ndarray, faces: np.ndarray, origins: np.ndarray, directions: np.ndarray, found_m: np.ndarray
) -> np.ndarray:
    """Return exact distances (n,) m of hits.

    Parameters
    ----------
    planes : (k, 4) float64
        See `face_planes`.
    faces : (n,) int
        The face that each ray hits; any number where it hits none.
    origins, directions : (n, 3) float64
        Rays; m, and unit length.
    found_m : (n,) float
        What the ray caster found; inf where a ray hits nothing.

    Returns
    -------
    (n,) float64, m
        The distance to the plane of the face. `found_m` where a ray hits nothing, or grazes a face so that the two
        differ by more than a millimetre.
    """
    plane = planes.take(faces, axis=0)
    exact = (plane[:, 3] - _dot(plane, origins)) / _dot(plane, directions)
    return np.where(np.abs(exact - found_m) < _CAST_M, exact, found_m)


def _dot(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Return products (n,) of rows by their first three numbers, in a fixed order of operations."""
    product = one[:, :3] * two
    return product[:, 0] + product[:, 1] + product[:, 2]
