"""A quadrotor: its parameters, and a cascade from velocities to attitude, to turn rates, to the rotors' thrusts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from minexplore.limits import Span, check_numbers
from minexplore.physics.robot_kind import LAMP_ABOVE_M, Robot, attach_file, check_measures
from minexplore.rotations import quaternion, rotate_inverse, rotation_matrices

# Of mjcf/quadrotor.xml; a test compares them.
MASS_KG, INERTIA_KGM2 = 1.325, (0.03692, 0.02568, 0.06222)
ARM_M, REACTION_M, MOST_N = (0.14, 0.18), 0.0201, 13.0
GRAVITY_MPS2 = 9.81
START_M = 1.2  # above the floor; half-way to a lower roof
_SPANS = {
    "climb_mps": Span(0.01, 20.0),
    "rings": Span(0, 30, whole=True),
    "velocity_gain_ps": Span(0.01, 100.0),
    "tilt_rad": Span(0.01, 1.2),
    "attitude_gain_ps": Span(0.01, 100.0),
    "rate_gain_ps": Span(0.01, 1000.0),
}


@dataclass(frozen=True)
class QuadrotorParams(Robot):
    """The robot of `mjcf/quadrotor.xml`, whose measures and sources stand there, its beams and its controller's gains.

    `radius_m` and `half_height_m` are those of the guard. Its beams lie on cones: `rings` above the robot's own plane
    and as many below it, evenly spaced up to the vertical, where there is one beam each. The gains, 1/s, are each a
    third of the next inner one or less, so that every loop follows the one about it; `climb_mps` is an assumption.
    """

    KIND: ClassVar[str] = "quadrotor"
    COMMANDS: ClassVar[int] = 4
    FLIES: ClassVar[bool] = True
    JOINTS: ClassVar[tuple[str, ...]] = ("free",)
    SIDES: ClassVar[tuple[tuple[str, ...], tuple[str, ...]]] = ((), ())

    radius_m: float = 0.36
    half_height_m: float = 0.07
    climb_mps: float = 1.0
    rings: int = 2
    velocity_gain_ps: float = 2.0
    tilt_rad: float = 0.35
    attitude_gain_ps: float = 8.0
    rate_gain_ps: float = 25.0

    def __post_init__(self) -> None:
        """Refuse values that make no robot; its measures are the file's."""
        check_numbers("quadrotor", self, _SPANS)
        check_measures("quadrotor", self, _SPANS)

    @property
    def origin_height_m(self) -> float:
        """Return how high the body's origin is over the guard's lower edge."""
        return self.half_height_m

    @property
    def top_m(self) -> float:
        """Return how high the top of its scanner is over the guard's lower edge."""
        return 2 * self.half_height_m

    @property
    def camera_m(self) -> tuple[float, float]:
        """Return how far ahead of the body's origin, and how high over the guard's lower edge, a camera is."""
        return 0.3, self.half_height_m  # before the rotors, within the guard

    @property
    def lamp_height_m(self) -> float:
        """Return how high a headlamp is above the body's origin."""
        return self.half_height_m + LAMP_ABOVE_M

    def beams(self, around: int) -> np.ndarray:
        """Return the directions (n, 3) of the beams in the robot's frame, `around` of them on each cone.

        First the plane's, counter-clockwise from ahead, then the cones from the lowest up, then straight down and up.
        """
        steps = [0, *range(-self.rings, 0), *range(1, self.rings + 1)]
        elevations = [k * (math.pi / 2) / (self.rings + 1) for k in steps]
        angles = [math.tau * k / around for k in range(around)]
        cones = [
            (math.cos(up) * math.cos(angle), math.cos(up) * math.sin(angle), math.sin(up))
            for up in elevations
            for angle in angles
        ]
        return np.array([*cones, (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)])

    def thrusts(
        self, quat: np.ndarray, speed_mps: np.ndarray, rates_radps: np.ndarray, wanted: np.ndarray
    ) -> np.ndarray:
        """Return the rotors' thrusts (k, 4) N, in the order of the file's actuators.

        Parameters
        ----------
        quat : (k, 4)
            Attitudes, world frame.
        speed_mps, rates_radps : (k, 3)
            Velocity in the world frame, turn rates in the body's: a free joint's `qvel`.
        wanted : (k, 4)
            Velocity ahead, to the left (both level, by the robot's heading) and up, m/s, and turn rate, rad/s.
        """
        axes = rotation_matrices(quat)
        ahead = axes[:, :2, 0] / np.sqrt(axes[:, 0, 0] ** 2 + axes[:, 1, 0] ** 2)[:, None]
        east = wanted[:, 0] * ahead[:, 0] - wanted[:, 1] * ahead[:, 1]
        north = wanted[:, 0] * ahead[:, 1] + wanted[:, 1] * ahead[:, 0]
        push = self.velocity_gain_ps * (np.stack([east, north, wanted[:, 2]], axis=1) - speed_mps)
        push[:, 0] -= wanted[:, 3] * north  # the wanted velocity turns with the robot
        push[:, 1] += wanted[:, 3] * east
        level, most = np.sqrt(push[:, 0] ** 2 + push[:, 1] ** 2), GRAVITY_MPS2 * math.tan(self.tilt_rad)
        push[:, :2] *= (most / np.maximum(level, most))[:, None]
        push[:, 2] = np.clip(push[:, 2], -0.5 * GRAVITY_MPS2, GRAVITY_MPS2) + GRAVITY_MPS2
        size = np.sqrt(push[:, 0] ** 2 + push[:, 1] ** 2 + push[:, 2] ** 2)
        up = push / size[:, None]  # where the robot's own up should point
        lean = [up[:, 0] * axes[:, 0, k] + up[:, 1] * axes[:, 1, k] + up[:, 2] * axes[:, 2, k] for k in range(3)]
        rates = np.stack([-self.attitude_gain_ps * lean[1], self.attitude_gain_ps * lean[0], wanted[:, 3]], axis=1)
        torque = self.rate_gain_ps * (rates - rates_radps) * np.array(INERTIA_KGM2)
        return _mix(MASS_KG * size * np.maximum(lean[2], 0.0), torque)

    def attach(self, spec: mujoco.MjSpec, name: str) -> None:
        """Add the robot to a world."""
        attach_file(spec, "quadrotor.xml", name)


def level_pose(T_world_mine: np.ndarray, place_m: np.ndarray, yaw_rad: float) -> np.ndarray:
    """Return the free joint's place (m) and quaternion (7,), world frame, of a robot that is level in the world.

    Its middle is at a place (3,) m of the mine frame, and it looks along `yaw_rad` there, seen from above.
    """
    R, t = T_world_mine[:3, :3], T_world_mine[:3, 3]
    ahead = rotate_inverse(np.array([[math.cos(yaw_rad), math.sin(yaw_rad), 0.0]]), R.T)[0]
    flat = ahead[:2] / math.sqrt(ahead[0] ** 2 + ahead[1] ** 2)
    turn = quaternion(np.array([[flat[0], -flat[1], 0], [flat[1], flat[0], 0], [0, 0, 1.0]]))
    return np.concatenate([rotate_inverse(place_m[None], R.T)[0] + t, turn])


def _mix(thrust: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Return the rotors' thrusts (k, 4) N that make a thrust (k,) N and a torque (k, 3) N m, within their limits."""
    roll, pitch = torque[:, 0] / (4 * ARM_M[1]), torque[:, 1] / (4 * ARM_M[0])
    most = MOST_N / 8  # of the thrust, for turning about the vertical: the weakest of the torques yields first
    yaw = np.clip(torque[:, 2] / (4 * REACTION_M), -most, most)
    base = thrust / 4
    rear, front = base + pitch, base - pitch
    rotors = np.stack([rear - roll - yaw, rear + roll + yaw, front + roll - yaw, front - roll + yaw], axis=1)
    return np.clip(rotors, 0.0, MOST_N)
