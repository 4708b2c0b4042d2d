"""What an inertial measurement unit in a robot reads: turn rates and specific force, with noise and bias."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from minexplore.sensing.params import SensorParams

_GRAVITY_MPS2 = np.array([0.0, 0.0, 9.81])


@dataclass(frozen=True)
class ImuReading:
    """The mean over one control step, robot's frame: `gyro_radps` (3,) and `force_mps2` (3,), which holds gravity."""

    gyro_radps: np.ndarray
    force_mps2: np.ndarray


class Imu:
    """An IMU at the robot's origin; each episode has a constant bias of its own."""

    def __init__(self, params: SensorParams, step_s: float) -> None:
        """Take the parameters and the time between readings."""
        self.params, self._step_s = params, step_s
        self._bias = np.zeros((2, 3))
        self._before_mps = self._velocity_mps = np.zeros(3)

    def begin(self, rng: np.random.Generator, velocity_mps: np.ndarray) -> None:
        """Draw the biases of an episode that begins with a velocity (3,), world frame."""
        spread = np.array([[self.params.gyro_bias_radps], [self.params.accel_bias_mps2]])
        self._bias = spread * rng.standard_normal((2, 3))
        self._before_mps = self._velocity_mps = velocity_mps.copy()

    def advance(self, velocity_mps: np.ndarray) -> None:
        """Take the velocity (3,), world frame, at the end of a control step."""
        self._before_mps, self._velocity_mps = self._velocity_mps, velocity_mps.copy()

    def read(self, axes: np.ndarray, turn_radps: np.ndarray, rng: np.random.Generator) -> ImuReading:
        """Return the reading of the last control step.

        Parameters
        ----------
        axes : (3, 3)
            The robot's axes, in columns, in the world frame, whose z is up against gravity.
        turn_radps : (3,), robot's frame
        """
        acceleration = (self._velocity_mps - self._before_mps) / self._step_s
        force = axes.T @ (acceleration + _GRAVITY_MPS2)
        densities = np.array([[self.params.gyro_noise_radps_rthz], [self.params.accel_noise_mps2_rthz]])
        noise = densities / np.sqrt(self._step_s) * rng.standard_normal((2, 3)) + self._bias
        return ImuReading(np.asarray(turn_radps + noise[0]), np.asarray(force + noise[1]))
