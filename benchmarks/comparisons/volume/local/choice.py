"""Which model a control step of a robot in a volume is stepped in, and where the planes under its wheels lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.comparisons.volume.local.models import PARKED, VolumeModels
from benchmarks.comparisons.volume.local.planes import TOLERANCE_M, FootPlanes
from minexplore.physics.robot import RobotParams
from minexplore.rotations import rotation_matrices

_LEAN = float(np.cos(np.radians(25.0)))  # of a robot on planes; the walls of its model reach as far
_RISE_MPS = 1.0  # likewise
_GAP_M = 0.1  # of a wheel from its plane: farther, the plane is another floor's
_CASTOR_M = 0.05  # radius, as in minexplore.physics.robot


@dataclass(frozen=True)
class StepChoice:
    """What a control step of n robots is stepped in.

    `tiles` (n, 2) as `VolumeModels.tiles_of` has them; the places (n, 4, 3) m and quaternions (n, 4, 4) of the boxes
    under the feet, parked for feet that touch the floor's parts. `on_plane` (n, 4) has the others, whose planes are
    `under`.
    """

    tiles: np.ndarray
    places: np.ndarray
    quaternions: np.ndarray
    on_plane: np.ndarray
    under: FootPlanes


class PlaneChooser:
    """Chooses for each robot the model and the planes of a control step."""

    def __init__(self, models: VolumeModels, tolerance_m: float = TOLERANCE_M) -> None:
        """Take the models, and how far the floor may be from the planes that stand for it."""
        self.models, self.tolerance_m = models, tolerance_m
        robot: RobotParams = models.robot
        half, end, castor = robot.wheel_base_m / 2, robot.radius_m - _CASTOR_M, _CASTOR_M - robot.wheel_radius_m
        self._feet = np.array([[0, half, 0], [0, -half, 0], [end, 0, castor], [-end, 0, castor]])
        self._radius = np.array([robot.wheel_radius_m] * 2 + [_CASTOR_M] * 2)[:, None]

    def feet_of(self, qpos: np.ndarray, axes: np.ndarray | None = None) -> np.ndarray:
        """Return the lowest places (n, 4, 3) m of the feet of robots that stand on a plane."""
        axes = rotation_matrices(qpos[:, 3:7]) if axes is None else axes
        found: np.ndarray = (
            qpos[:, None, :3] + self._feet @ axes.transpose(0, 2, 1) - self._radius * axes[:, None, :, 2]
        )
        return found

    def choose(self, qpos: np.ndarray, qvel: np.ndarray) -> StepChoice:
        """Return the choice for robots with these positions (n, 7) and velocities (n, 6) of their free joints."""
        models = self.models
        axes = rotation_matrices(qpos[:, 3:7])
        arms = self._feet @ axes.transpose(0, 2, 1)
        foot = self.feet_of(qpos, axes)
        spin = (axes @ qvel[:, 3:6, None])[:, None, :, 0]
        speed = qvel[:, None, :2] + spin[..., [1, 2]] * arms[..., [2, 0]] - spin[..., [2, 0]] * arms[..., [1, 2]]
        fast = np.sqrt((speed**2).sum(axis=2))
        under = models.planes.under(qpos[:, :3], foot[..., :2] + speed * (models.task.control_s / 2), fast)
        gap = foot[..., 2] - under.heights(foot[..., :2])
        good = (under.error_m <= self.tolerance_m) & (np.abs(gap) < _GAP_M)
        good &= ((axes[:, 2, 2] > _LEAN) & (np.abs(qvel[:, 2]) < _RISE_MPS))[:, None]
        tiles = np.zeros((len(qpos), 2), dtype=int)
        tiles[:, 1] = ~good @ (1 << np.arange(good.shape[1]))
        for with_floor in (False, True):
            those = (tiles[:, 1] > 0) == with_floor
            tiles[those, 0] = models.number_of(qpos[those, :3], with_floor)
        places, quaternions = boxes_under(under)
        places[~good] = np.broadcast_to(PARKED, places.shape)[~good]
        return StepChoice(tiles, places, quaternions, good, under)


def boxes_under(under: FootPlanes) -> tuple[np.ndarray, np.ndarray]:
    """Return places (n, k, 3) m and quaternions (n, k, 4) of boxes whose upper faces are the planes under k feet."""
    a, b, height = np.moveaxis(under.plane, 2, 0)
    quaternions = np.stack([1 + np.sqrt(1 + a * a + b * b), b, -a, np.zeros_like(a)], axis=2)
    quaternions /= np.sqrt((quaternions**2).sum(axis=2, keepdims=True))
    return np.concatenate([under.nodes_m, height[..., None]], axis=2), quaternions
