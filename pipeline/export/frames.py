"""Transforms between the mine frame and the frames that formats have."""

from __future__ import annotations

import numpy as np

from minexplore.rotations import quaternion
from pipeline.types import Points3

Z_UP_TO_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])  # glTF's y is up


def apply(T: np.ndarray, points_m: Points3) -> Points3:
    """Return points (n, 3) m moved by a transform (4, 4)."""
    return points_m @ T[:3, :3].T + T[:3, 3]


def upwards(texcoords: np.ndarray) -> np.ndarray:
    """Return texture coordinates (n, 2) with v from a picture's last row upwards, as OBJ and USD have it."""
    return np.column_stack([texcoords[:, 0], 1 - texcoords[:, 1]])


def turn_to(axis: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return a rotation (3, 3) that turns one unit vector (3,) into another."""
    cross, cosine = np.cross(axis, direction), float(axis @ direction)
    if cosine < -1 + 1e-9:  # half a turn about any axis across
        across = np.eye(3)[np.abs(axis).argmin()]
        across -= across @ axis * axis
        across /= np.linalg.norm(across)
        return 2 * np.outer(across, across) - np.eye(3)
    skew = np.array([[0, -cross[2], cross[1]], [cross[2], 0, -cross[0]], [-cross[1], cross[0], 0]])
    return np.eye(3) + skew + skew @ skew / (1 + cosine)


def turn_quaternion(axis: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return the same as a unit quaternion (4,), w first."""
    return quaternion(turn_to(axis, direction))
