"""What an inertial measurement unit in a robot reads: turn rates and specific force, with noise and bias."""

from __future__ import annotations

from collections.abc import Iterator

import gymnasium
import numpy as np

from minexplore.sensors.kind import SensorKind
from minexplore.sensors.ros import MessageType, RosMessage, header_of, rotation_of, vector_of
from minexplore.sensors.sensed_robot import SensedRobot

_GRAVITY_MPS2 = np.array([0.0, 0.0, 9.81])
_MOST = np.array([35.0] * 3 + [235.0] * 3, dtype=np.float32)  # Bosch BMI088: 2,000 deg/s and 24 g
_MESSAGE = MessageType(
    "sensor_msgs/msg/Imu",
    "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
    "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
    "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance",
    ("std_msgs/Header", "geometry_msgs/Quaternion", "geometry_msgs/Vector3"),
)


class Imu(SensorKind):
    """An IMU at the robot's origin; each episode has a constant bias of its own."""

    CHANGES = ("_bias",)

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Return its name."""
        return ("imu",)

    @classmethod
    def space(cls, name: str) -> gymnasium.spaces.Box:
        """Return the space of turn rates, rad/s, and forces, m/s2."""
        return gymnasium.spaces.Box(-_MOST, _MOST, dtype=np.float32)

    @classmethod
    def gives(cls, name: str) -> str:
        """Return what `capture` gives."""
        return "three turn rates, then three forces"

    def __init__(self, robot: SensedRobot) -> None:
        """Take the robot."""
        super().__init__(robot)
        self._bias = np.zeros((2, 3))

    def begin(self, rng: np.random.Generator) -> None:
        """Draw the biases of an episode."""
        params = self.robot.params
        self._bias = np.array([[params.gyro_bias_radps], [params.accel_bias_mps2]]) * rng.standard_normal((2, 3))

    def read(self, name: str, rng: np.random.Generator) -> np.ndarray:
        """Return the means over the last control step, robot's frame: turn rates (3,), and forces (3,) with gravity."""
        robot, params = self.robot, self.robot.params
        acceleration = (robot.velocity_mps - robot.before_mps) / robot.step_s
        force = robot.axes.T @ (acceleration + _GRAVITY_MPS2)
        densities = np.array([[params.gyro_noise_radps_rthz], [params.accel_noise_mps2_rthz]])
        noise = densities / np.sqrt(robot.step_s) * rng.standard_normal((2, 3)) + self._bias
        return np.concatenate([robot.robots.qvel[robot.row, 3:6] + noise[0], force + noise[1]])

    def messages(self, name: str, time_ns: int, reading: np.ndarray) -> Iterator[RosMessage]:
        """Return the message; the orientation is not measured, which ROS states by a -1."""
        unknown, nothing = [-1.0, *[0.0] * 8], [0.0] * 9
        content = {
            **{"header": header_of(time_ns, "base_link"), "orientation": rotation_of(np.eye(3))},
            **{"orientation_covariance": unknown, "angular_velocity": vector_of(reading[:3])},
            **{"angular_velocity_covariance": nothing, "linear_acceleration": vector_of(reading[3:])},
            "linear_acceleration_covariance": nothing,
        }
        yield RosMessage("/imu", _MESSAGE, content)
