"""Which model a control step of a robot in a volume is stepped in, and where the planes under its feet lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from minexplore.physics.robot import CASTOR_M
from minexplore.volume.flat import plane_quaternions
from minexplore.volume.models import PARKED_M, VolumeModels, code_of
from minexplore.volume.planes import TOLERANCE_M, FloorPlanes, FootPlanes

_LEAN = float(np.cos(np.radians(25.0)))  # of a robot on planes; the walls of its model reach as far
_RISE_MPS = 1.0  # likewise
_GAP_M = 0.1  # of a foot from its plane: farther, the plane is another floor's


@dataclass(frozen=True)
class StepChoice:
    """What a control step of n robots is stepped in.

    `tiles` (n, 2) as `VolumeModels.tiles_of` has them; the places (n, 4, 3) m, mine frame, and quaternions (n, 4, 4) of
    the boxes under the feet, parked for feet that touch the floor's parts. `on_plane` (n, 4) has the others, whose
    planes are `under`.
    """

    tiles: np.ndarray
    places: np.ndarray
    quaternions: np.ndarray
    on_plane: np.ndarray
    under: FootPlanes


class PlaneChooser:
    """Chooses for each robot the model and the planes of a control step."""

    def __init__(self, models: VolumeModels, planes: FloorPlanes, tolerance_m: float = TOLERANCE_M) -> None:
        """Take the models, and how far the floor may be from the planes that stand for it."""
        self.models, self.planes, self.tolerance_m = models, planes, tolerance_m
        robot = models.robot
        half, end, castor = robot.between_sides_m / 2, robot.radius_m - CASTOR_M, CASTOR_M - robot.wheel_radius_m
        self._half_m, self._end_m, self._castor_m = half, end, castor
        self._radius = np.array([robot.wheel_radius_m] * 2 + [CASTOR_M] * 2)[:, None]
        self._bits = 1 << np.arange(len(PARKED_M))

    def feet_of(self, places_m: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """Return the lowest places (n, 4, 3) m of the feet of robots (n, 3) m that stand on a plane; see `choose`."""
        return self._under(places_m, self._arms(axes), axes)

    def _under(self, places_m: np.ndarray, arms: np.ndarray, axes: np.ndarray) -> np.ndarray:
        found: np.ndarray = places_m[:, None] + arms - self._radius * axes[:, None, :, 2]
        return found

    def _arms(self, axes: np.ndarray) -> np.ndarray:
        """Return from each robot's place to the middles of its feet (n, 4, 3) m."""
        ahead, aside, up = self._end_m * axes[..., 0], self._half_m * axes[..., 1], self._castor_m * axes[..., 2]
        found = np.empty((len(axes), len(PARKED_M), 3))
        found[:, 0], found[:, 1], found[:, 2], found[:, 3] = aside, -aside, up + ahead, up - ahead
        return found

    def choose(self, places_m: np.ndarray, axes: np.ndarray, qvel: np.ndarray, zones: np.ndarray) -> StepChoice:
        """Return the choice for robots.

        Parameters
        ----------
        places_m : (n, 3) float64, m, mine frame
            Of their free joints.
        axes : (n, 3, 3) float64
            Their axes ahead, to the left and up as columns, mine frame.
        qvel : (n, 6)
            Their speeds, m/s, and turn rates in the robots' own frames, rad/s.
        zones : (n, 2) int
            The floor zones of their left and right wheels.
        """
        if not self.models.has_planes:
            return self._on_parts(places_m, zones)
        arms = self._arms(axes)
        foot = self._under(places_m, arms, axes)
        spin = axes[..., 0] * qvel[:, 3:4] + axes[..., 1] * qvel[:, 4:5] + axes[..., 2] * qvel[:, 5:6]
        speed = np.empty((*foot.shape[:2], 2))
        speed[..., 0] = qvel[:, :1] + spin[:, 1:2] * arms[..., 2] - spin[:, 2:] * arms[..., 1]
        speed[..., 1] = qvel[:, 1:2] + spin[:, 2:] * arms[..., 0] - spin[:, :1] * arms[..., 2]
        fast = np.sqrt(speed[..., 0] ** 2 + speed[..., 1] ** 2)
        under = self.planes.under(places_m, foot[..., :2] + speed * (self.models.task.control_s / 2), fast)
        gap = foot[..., 2] - under.heights(foot[..., :2])
        good = (under.error_m <= self.tolerance_m) & (np.abs(gap) < _GAP_M)
        good &= ((axes[:, 2, 2] > _LEAN) & (np.abs(qvel[:, 2]) < _RISE_MPS))[:, None]
        places = np.empty(foot.shape)
        places[..., :2], places[..., 2] = under.nodes_m, under.plane[..., 2]
        if np.count_nonzero(good) < good.size:
            places = np.where(good[..., None], places, PARKED_M)
        return StepChoice(self._tiles(places_m, good, zones), places, plane_quaternions(under.plane), good, under)

    def _on_parts(self, places_m: np.ndarray, zones: np.ndarray) -> StepChoice:
        """Return the choice for robots whose feet all touch the floor's parts."""
        count, feet = len(places_m), len(PARKED_M)
        good, turn = np.zeros((count, feet), bool), np.zeros((count, feet, 4))
        turn[..., 0] = 1.0
        under = FootPlanes(np.zeros((count, feet, 3)), np.zeros((count, feet, 2)), np.full((count, feet), np.inf))
        places = np.broadcast_to(PARKED_M, (count, feet, 3)).copy()
        return StepChoice(self._tiles(places_m, good, zones), places, turn, good, under)

    def _tiles(self, places_m: np.ndarray, good: np.ndarray, zones: np.ndarray) -> np.ndarray:
        on_parts = (~good * self._bits).sum(axis=1)
        tiles = np.empty((len(places_m), 2), dtype=int)
        tiles[:, 0], tiles[:, 1] = self.models.numbers_of(places_m, on_parts > 0), code_of(on_parts, zones)
        return tiles
