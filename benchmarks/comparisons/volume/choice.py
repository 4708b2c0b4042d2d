"""Which model a control step of a robot in a volume is stepped in, and where the planes under its wheels lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.comparisons.volume.contact_planes import SPEED_MPS, TOLERANCE_M, FootPlanes
from benchmarks.comparisons.volume.local_rock import HALF_M, PARKED, VolumeModels
from minexplore.physics.robot import RobotParams
from minexplore.rotations import rotation_matrices

_LEAN = float(np.cos(np.radians(25.0)))  # of a robot on planes; the walls of its model reach as far
_GAP_M = 0.1  # of a wheel from its plane: farther, the plane is another floor's
_CASTOR_M = 0.05  # radius, as in minexplore.physics.robot


@dataclass(frozen=True)
class Choice:
    """What a control step of n robots is stepped in.

    `tiles` (n, 2) as `VolumeModels.tiles_of` has them; the places (n, 8, 3) m and quaternions (n, 8, 4) of the boxes
    under the feet, parked where the model has all parts.
    """

    tiles: np.ndarray
    places: np.ndarray
    quaternions: np.ndarray


class PlaneChooser:
    """Chooses for each robot the model and the planes of a control step."""

    def __init__(self, models: VolumeModels, tolerance_m: float = TOLERANCE_M) -> None:
        """Take the models, and how far the floor may be from the planes that stand for it."""
        self.models, self.tolerance_m = models, tolerance_m
        robot: RobotParams = models.robot
        half, end, castor = robot.wheel_base_m / 2, robot.radius_m - _CASTOR_M, _CASTOR_M - robot.wheel_radius_m
        self._feet = np.array([[0, half, 0], [0, -half, 0], [end, 0, castor], [-end, 0, castor]])
        self._radius = np.array([robot.wheel_radius_m] * 2 + [_CASTOR_M] * 2)[:, None]

    def choose(self, qpos: np.ndarray, qvel: np.ndarray) -> Choice:
        """Return the choice for robots with these positions (n, 7) and velocities (n, 6) of their free joints."""
        models = self.models
        axes = rotation_matrices(qpos[:, 3:7])
        up = axes[:, None, :, 2]
        arms = self._feet @ axes.transpose(0, 2, 1)
        spin = (axes @ qvel[:, 3:6, None])[:, None, :, 0]
        speed = qvel[:, None, :2] + spin[..., [1, 2]] * arms[..., [2, 0]] - spin[..., [2, 0]] * arms[..., [1, 2]]
        foot = qpos[:, None, :3] + arms - self._radius * up
        under = models.planes.under(qpos[:, :3], foot[..., :2] + speed * (models.task.control_s / 2))
        gap = foot[..., 2] - under.heights(foot[..., :2])
        near = (under.error_m <= self.tolerance_m) & (np.abs(gap) < _GAP_M) & ((speed**2).sum(axis=2) < SPEED_MPS**2)
        good = near.all(axis=1) & (up[:, 0, 2] > _LEAN) & (np.abs(qvel[:, 2]) < SPEED_MPS)
        tiles = np.zeros((len(qpos), 2), dtype=int)
        tiles[good, 0] = models.number_of(qpos[good, :3], False)
        tiles[~good, 0], tiles[~good, 1] = models.number_of(qpos[~good, :3], True), 1
        places, quaternions = boxes_under(under)
        places[~good], quaternions[~good] = PARKED, (1.0, 0.0, 0.0, 0.0)
        return Choice(tiles, places, quaternions)


def boxes_under(under: FootPlanes) -> tuple[np.ndarray, np.ndarray]:
    """Return places (n, 2 k, 3) m and quaternions (n, 2 k, 4) of boxes whose upper faces are the planes under k feet.

    The boxes of a ridge end at it; those of a valley go on under each other; of one plane the second box is parked.
    """
    n, k = under.bend.shape
    a, b, height = np.moveaxis(under.planes, 3, 0)
    quaternions = np.stack([1 + np.sqrt(1 + a * a + b * b), b, -a, np.zeros_like(a)], axis=3)
    quaternions /= np.sqrt((quaternions**2).sum(axis=3, keepdims=True))
    places = np.empty((n, k, 2, 3))
    places[..., :2], places[..., 2] = under.nodes_m[:, :, None], height
    single = under.bend == 0
    places[single, 1] = np.broadcast_to(PARKED[1 : 2 * k : 2], (n, k, 3))[single]
    ridge = under.bend < 0
    if ridge.any():
        places[ridge], quaternions[ridge] = _boxes_at_ridge(
            under.planes[ridge], under.nodes_m[ridge], quaternions[ridge]
        )
    return places.reshape(n, 2 * k, 3), quaternions.reshape(n, 2 * k, 4)


def _boxes_at_ridge(planes: np.ndarray, nodes: np.ndarray, tilt: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return places (m, 2, 3) m and quaternions (m, 2, 4) of boxes that end where two planes (m, 2, 3) meet."""
    apart = planes[:, 0] - planes[:, 1]
    steep = np.maximum(np.sum(apart[:, :2] ** 2, axis=1, keepdims=True), 1e-12)
    start = -apart[:, 2:] * apart[:, :2] / steep  # of the ridge, from the node, in plan
    outward = apart[:, :2] / np.sqrt(steep)  # away from the first plane's side
    along = np.column_stack([outward[:, 1], -outward[:, 0]])
    top = np.sum(planes[:, 0, :2] * start, axis=1) + planes[:, 0, 2]
    rise = np.sum(planes[:, 0, :2] * along, axis=1)
    ridge = np.column_stack([along, rise]) / np.sqrt(1 + rise * rise)[:, None]
    w, vector = tilt[..., :1], tilt[..., 1:]
    twice = 2 * np.cross(vector, ridge[:, None])
    flat = ridge[:, None] - w * twice + np.cross(vector, twice)  # the ridge before the box is tilted
    half = np.arctan2(flat[..., 1], flat[..., 0])[..., None] / 2
    cos, sin = np.cos(half), np.sin(half)
    x, y = vector[..., :1], vector[..., 1:2]
    quaternions = np.concatenate([w * cos, x * cos + y * sin, y * cos - x * sin, w * sin], axis=2)
    normal = np.concatenate([-planes[..., :2], np.ones((*planes.shape[:2], 1))], axis=2)
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    across = np.cross(normal, ridge[:, None])
    across *= -np.sign(np.sum(across[..., :2] * outward[:, None], axis=2, keepdims=True)) * np.array([1, -1])[:, None]
    edge = np.column_stack([nodes + start, top])
    return edge[:, None] + HALF_M[1] * across, quaternions
