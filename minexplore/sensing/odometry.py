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
    `resolution_m` a count of the encoder.
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
    """The counted poses of n robots: x, y, m, and yaw, rad, in the mine frame, from where each began."""

    def __init__(self, count: int, wheel_radius_m: float, wheel_base_m: float, share: float = 1.0) -> None:
        """Take the robots' measures; `share` multiplies all errors but the encoders' counts."""
        fit = fitted_odometry()
        self._radius_m, self._base_m, self._fit, self._share = wheel_radius_m, wheel_base_m, fit, share
        self.poses = np.zeros((count, 3))
        self._wheels = np.zeros((count, 2))  # last true angles, rad
        self._travel, self._counted = np.zeros((count, 2)), np.zeros((count, 2))  # m, true and in whole counts
        self._drift = np.zeros(count)
        self._rngs: list[np.random.Generator | None] = [None] * count

    def begin(self, robot: int, rng: np.random.Generator) -> None:
        """Draw a robot's errors for an episode from a child of its generator, which itself is left as it is."""
        own = rng.spawn(1)[0]
        self._rngs[robot] = own
        self._drift[robot] = own.normal(0.0, self._share * self._fit.heading_drift_radpm)

    def place(self, robots: np.ndarray, poses: np.ndarray, wheels_rad: np.ndarray) -> None:
        """Set the poses (k, 3) of robots (k,), whose wheels have angles (k, 2), left and right."""
        self.poses[robots], self._wheels[robots] = poses, wheels_rad
        self._travel[robots] = self._counted[robots] = 0.0

    def advance(self, robots: np.ndarray, wheels_rad: np.ndarray, friction: np.ndarray) -> None:
        """Count the turn of the wheels of robots (k,) to angles (k, 2), on floors of frictions (k,)."""
        fit, step = self._fit, self._fit.resolution_m
        rolled = (wheels_rad - self._wheels[robots]) * self._radius_m
        self._wheels[robots] = wheels_rad
        self._travel[robots] += rolled / (1 - zone_slip(self._share * fit.slip, friction))[:, None]
        whole = np.floor(self._travel[robots] / step) * step
        counted = whole - self._counted[robots]
        self._counted[robots] = whole
        ahead = counted.mean(axis=1)
        turn = (counted[:, 1] - counted[:, 0]) / self._base_m + self._drift[robots] * np.abs(ahead)
        turn += self._share * fit.heading_noise_rad_rtm * np.sqrt(np.abs(ahead)) * self._normals(robots)
        middle = self.poses[robots, 2] + turn / 2
        self.poses[robots] += np.column_stack([ahead * np.cos(middle), ahead * np.sin(middle), turn])
        self.poses[robots, 2] = (self.poses[robots, 2] + np.pi) % (2 * np.pi) - np.pi

    def _normals(self, robots: np.ndarray) -> np.ndarray:
        rngs = [self._rngs[robot] for robot in robots.tolist()]
        return np.array([rng.standard_normal() if rng is not None else 0.0 for rng in rngs])
