"""Where the floor of a volume is one plane: there all feet stand on it, and nothing is chosen."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from minexplore.floors.volume_arrays import VolumeFacets
from minexplore.physics.robot import FLOOR_BIT
from minexplore.rotations import rotation_matrices
from minexplore.volume.planes import TOLERANCE_M

_PLUMB = 1e-6  # of a normal's length
_LEVEL = 1e-6  # rise over run


@dataclass(frozen=True)
class FlatTile:
    """A square of one plane: slopes east and north and height at its middle (3,), m, the middle (2,) m, half a side."""

    plane: np.ndarray
    middle_m: np.ndarray
    half_m: float

    def add_to(self, body: mujoco.MjsBody) -> None:
        """Add a cube whose upper face is the plane."""
        quaternion = plane_quaternions(self.plane[None])[0]
        up = rotation_matrices(quaternion[None])[0, :, 2]
        place = np.append(self.middle_m, self.plane[2]) - self.half_m * up
        cube = body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[self.half_m] * 3, pos=place, quat=quaternion)
        cube.contype, cube.conaffinity = FLOOR_BIT, 0


def plane_quaternions(planes: np.ndarray) -> np.ndarray:
    """Return quaternions (..., 4), w first, that turn up to the normals of planes (..., 3): slopes, and a height."""
    a, b = planes[..., 0], planes[..., 1]
    slope = a * a + b * b
    w = 1 + np.sqrt(1 + slope)
    size = np.sqrt(w * w + slope)
    found = np.zeros((*a.shape, 4))
    found[..., 0], found[..., 1], found[..., 2] = w / size, b / size, -a / size
    return found


class FlatFloors:
    """The facets of a volume, asked whether their floor is one plane.

    `level` is the whole mine's floor if it is one level plane, else None.
    """

    def __init__(self, facets: VolumeFacets) -> None:
        """Take the facets."""
        self._corners = facets.vertices[facets.faces]
        self._low, self._high = (side.T.copy() for side in (self._corners.min(axis=1), self._corners.max(axis=1)))
        self._normal = facets.normals
        size = np.linalg.norm(self._normal, axis=1)
        self._faces_up = self._normal[:, 2] < -_PLUMB * size
        self._slope = -self._normal[:, :2] / np.where(self._faces_up, self._normal[:, 2], 1.0)[:, None]
        whole = self._one_plane(self._corners.min(axis=(0, 1)), self._corners.max(axis=(0, 1)))
        self.level = None
        if whole is not None and np.abs(whole.plane[:2]).max() <= _LEVEL:
            self.level = replace(whole, plane=np.array([0.0, 0.0, whole.plane[2]]))

    def within(self, low_m: np.ndarray, high_m: np.ndarray) -> FlatTile | None:
        """Return the plane of the floors in a box from `low_m` (3,) to `high_m` (3,) m, mine frame, if it is one.

        All facets that face up lie in it, walls that lean back too, and nothing goes down from it.
        """
        return self.level or self._one_plane(low_m, high_m)

    def _one_plane(self, low_m: np.ndarray, high_m: np.ndarray) -> FlatTile | None:
        near = np.flatnonzero(((self._low <= high_m[:, None]) & (self._high >= low_m[:, None])).all(axis=0))
        up = near[self._faces_up[near]]
        if not len(up):
            return None
        middle, half = (low_m + high_m)[:2] / 2, (high_m - low_m)[:2] / 2
        slope, corner = self._slope[up], self._corners[up, 0]
        height = corner[:, 2] + ((middle - corner[:, :2]) * slope).sum(axis=1)
        largest = int(np.abs(self._normal[up, 2]).argmax())
        off = np.abs(slope - slope[largest]) @ half + np.abs(height - height[largest])
        plane = np.append(slope[largest], height[largest])
        under = plane[2] + (self._corners[near][..., :2] - middle) @ plane[:2] - self._corners[near][..., 2]
        return FlatTile(plane, middle, float(half.max())) if max(off.max(), under.max()) <= TOLERANCE_M else None
