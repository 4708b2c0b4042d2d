"""Rotations of many vectors at once, rounded alike for any number of them."""

from __future__ import annotations

import mujoco
import numpy as np

_FEW = 3  # vectors that Python's numbers rotate in half the time that arrays take; both round alike


def rotate_inverse(vectors: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return the rows of `vectors` (n, 3) rotated by the inverse of `rotation` (3, 3).

    This is `vectors @ rotation`. BLAS may round that product differently for another n or on another processor; this
    function does not, so that one robot and many give the same numbers everywhere.
    """
    if len(vectors) <= _FEW:
        (a, b, c), (d, e, f), (g, h, i) = rotation.tolist()
        turned = [(x * a + y * d + z * g, x * b + y * e + z * h, x * c + y * f + z * i) for x, y, z in vectors.tolist()]
        return np.array(turned).reshape(-1, 3)
    return vectors[:, :1] * rotation[0] + vectors[:, 1:2] * rotation[1] + vectors[:, 2:] * rotation[2]


def rotation_matrices(quat: np.ndarray) -> np.ndarray:
    """Return the rotation matrices (n, 3, 3) of unit quaternions (n, 4), w first."""
    w, x, y, z = quat[0].tolist() if len(quat) == 1 else quat.T
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    wx, wy, wz, xy, xz, yz = w * x, w * y, w * z, x * y, x * z, y * z
    rows = (
        (ww + xx - yy - zz, 2 * (xy - wz), 2 * (xz + wy)),
        (2 * (xy + wz), ww - xx + yy - zz, 2 * (yz - wx)),
        (2 * (xz - wy), 2 * (yz + wx), ww - xx - yy + zz),
    )
    if len(quat) == 1:
        return np.array([rows])
    matrices = np.empty((len(quat), 3, 3))
    for i, row in enumerate(rows):
        for j, column in enumerate(row):
            matrices[:, i, j] = column
    return matrices


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """Return the unit quaternion (4,), w first, of a rotation matrix (3, 3)."""
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, rotation.ravel())
    return quat
