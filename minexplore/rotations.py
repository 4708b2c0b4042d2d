"""Rotations of many vectors at once, rounded alike for any number of them."""

from __future__ import annotations

import mujoco
import numpy as np


def rotate_inverse(vectors: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return the rows of `vectors` (n, 3) rotated by the inverse of `rotation` (3, 3).

    This is `vectors @ rotation`. BLAS may round that product differently for another n or on another processor; this
    function does not, so that one robot and many give the same numbers everywhere.
    """
    return vectors[:, :1] * rotation[0] + vectors[:, 1:2] * rotation[1] + vectors[:, 2:] * rotation[2]


def rotation_matrices(quat: np.ndarray) -> np.ndarray:
    """Return the rotation matrices (n, 3, 3) of unit quaternions (n, 4), w first."""
    w, x, y, z = quat.T
    return np.stack(
        [
            np.stack([w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=-1),
            np.stack([2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)], axis=-1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z], axis=-1),
        ],
        axis=1,
    )


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """Return the unit quaternion (4,), w first, of a rotation matrix (3, 3)."""
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, rotation.ravel())
    return quat
