"""The pose that a robot counts from its wheels, with errors fitted to a real wheel log.

The log is of a Husky A200 in the embedded mine; `python -m benchmarks odometry-fit` makes the numbers of
`odometry.json` from it.
"""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

_FIT = Path(__file__).parent / "odometry.json"


@dataclass(frozen=True)
class OdometryFit:
    """What a wheel log and surveyed poses say of odometry.

    `slip` is the share of the wheels' travel that the robot did not go on dry ground, `heading_drift_radpm` the
    constant error of the heading by travel, `heading_noise_rad_rtm` that which grows with the root of travel,
    `resolution_m` the smallest step of the log. The encoders themselves make 78,000 counts a metre
    (Clearpath, Husky A200 User Manual).
    """

    slip: float
    heading_drift_radpm: float
    heading_noise_rad_rtm: float
    resolution_m: float


@functools.cache
def fitted_odometry() -> OdometryFit:
    """Return the kept fit."""
    record = json.loads(_FIT.read_text())
    return OdometryFit(**record["fit"])


def zone_slip(slip: float, friction: np.ndarray) -> np.ndarray:
    """Return the shares (n,) of wheel travel that slips, on ground of frictions (n,) where dry ground has 1.

    A wheel that pushes with the same force slips in inverse proportion to the friction, an assumption: the log is of
    one floor. Slip is at most 0.9.
    """
    shares: np.ndarray = np.minimum(slip / np.maximum(friction, 1e-3), 0.9)
    return shares


class WheelOdometry:
    """The counted poses of n robots: x, y, m, and yaw, rad, in the mine frame, from where each began.

    The errors are added to the true motion, not to the turn of the simulated wheels: those spin when a command changes
    at once, which no driver of the log's robot lets happen, and the fit holds the slip already.
    """

    def __init__(self, count: int, wheel_base_m: float, fit: OdometryFit | None = None) -> None:
        """Take the distance between the wheels, and errors other than the fitted ones."""
        self._base_m, self._fit = wheel_base_m, fit or fitted_odometry()
        self.poses, self._true = np.zeros((count, 3)), np.zeros((count, 3))
        self._travel, self._counted = np.zeros((count, 2)), np.zeros((count, 2))  # m, left and right; in whole counts
        self._drift = np.zeros(count)
        self._rngs: list[np.random.Generator | None] = [None] * count

    def begin(self, robot: int, rng: np.random.Generator) -> None:
        """Draw a robot's errors for an episode from a child of its generator, whose next numbers stay."""
        own = rng.spawn(1)[0]
        self._rngs[robot] = own
        self._drift[robot] = own.normal(0.0, self._fit.heading_drift_radpm)

    def place(self, robots: np.ndarray, poses: np.ndarray) -> None:
        """Let robots (k,) begin at their true poses (k, 3)."""
        self.poses[robots] = self._true[robots] = poses
        self._travel[robots] = self._counted[robots] = 0.0

    def advance(self, robots: np.ndarray, poses: np.ndarray, friction: np.ndarray) -> None:
        """Count the motion of robots (k,) to their true poses (k, 3), on floors of frictions (k,)."""
        before, step = self._true[robots], self._fit.resolution_m
        moved, turned = poses[:, :2] - before[:, :2], wrapped(poses[:, 2] - before[:, 2])
        self._true[robots] = poses
        middle = before[:, 2] + turned / 2
        rolled = moved[:, 0] * np.cos(middle) + moved[:, 1] * np.sin(middle)
        rolled = rolled / (1 - zone_slip(self._fit.slip, friction))
        turned = turned + self._drift[robots] * np.abs(rolled)
        turned += self._fit.heading_noise_rad_rtm * np.sqrt(np.abs(rolled)) * self._normals(robots)
        half = turned * self._base_m / 2
        self._travel[robots] += np.column_stack([rolled - half, rolled + half])
        whole = np.floor(self._travel[robots] / step) * step
        left, right = (whole - self._counted[robots]).T
        self._counted[robots] = whole
        ahead, turn = (left + right) / 2, (right - left) / self._base_m
        middle = self.poses[robots, 2] + turn / 2
        self.poses[robots] += np.column_stack([ahead * np.cos(middle), ahead * np.sin(middle), turn])
        self.poses[robots, 2] = wrapped(self.poses[robots, 2])

    def _normals(self, robots: np.ndarray) -> np.ndarray:
        rngs = [self._rngs[robot] for robot in robots.tolist()]
        return np.array([rng.standard_normal() if rng is not None else 0.0 for rng in rngs])


def wrapped(angle_rad: np.ndarray) -> np.ndarray:
    """Return angles (n,) rad between -pi and pi."""
    between: np.ndarray = (angle_rad + np.pi) % (2 * np.pi) - np.pi
    return between
