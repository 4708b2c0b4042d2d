"""A skid-steer robot of a Husky's size: four driven wheels that slip sideways when it turns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from minexplore.bundle import is_floor
from minexplore.limits import Span, check_numbers
from minexplore.physics.robot_kind import LAMP_ABOVE_M, DrivenRobot, attach_file, check_measures

# MuJoCo's contact time: the robot's weight presses its wheels in by 5 mm, as a tyre gives. On the rigid floor of 0.02 s
# wheels that slip sideways hop at physics steps of 5 ms, and turning varies by a factor of two with the command.
_TYRE_S = 0.1
_WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
_SPANS = {
    "max_speed_mps": Span(0.01, 50.0),
    "turn_gain": Span(0.1, 10.0),
    "travel_scale": Span(0.1, 10.0),
    "side_ratio": Span(0.1, 10.0),
    "speed_noise_mps": Span(0.0, 10.0),
    "turn_noise_radps": Span(0.0, 10.0),
}


@dataclass(frozen=True)
class HuskyParams(DrivenRobot):
    """The robot of `mjcf/husky.xml`, whose measures and sources stand there, and what its wheels make of a command.

    `radius_m` is that of the disc about its 990 x 670 mm. `max_speed_mps` is its manual's. `travel_scale` and
    `side_ratio`, the way over ground by metre of wheel and the right side's share of the left one's, and both noises
    are fitted to the wheel log of the Chilean mine by `python -m benchmarks wheel-log`; noise is drawn once a control
    step. `turn_gain` makes up for wheels that slip sideways, as the real one's driver does by 1.875 (husky/husky,
    husky_control/config/control.yaml); with it turns in MuJoCo on level ground are those commanded to 20 % or so.
    """

    KIND: ClassVar[str] = "husky"
    JOINTS: ClassVar[tuple[str, ...]] = ("free", *_WHEELS)
    SIDES: ClassVar[tuple[tuple[str, ...], tuple[str, ...]]] = (_WHEELS[0::2], _WHEELS[1::2])

    radius_m: float = 0.598
    wheel_radius_m: float = 0.1651
    track_m: float = 0.5708
    max_speed_mps: float = 1.0
    turn_gain: float = 2.6
    travel_scale: float = 0.966
    side_ratio: float = 0.983
    speed_noise_mps: float = 0.037
    turn_noise_radps: float = 0.0114
    sensor_height_m: float = 0.5
    scanner_radius_m: float = 0.09
    scanner_height_m: float = 0.31

    def __post_init__(self) -> None:
        """Refuse values that make no robot; its measures are the file's."""
        check_numbers("husky", self, _SPANS)
        check_measures("husky", self, _SPANS)

    @property
    def lamp_height_m(self) -> float:
        """Return how high a headlamp is above the axles: on top of the scanner."""
        return self.sensor_height_m + self.scanner_height_m / 2 - self.wheel_radius_m + LAMP_ABOVE_M

    @property
    def between_sides_m(self) -> float:
        """Return how far the wheels of both sides are apart."""
        return self.track_m

    def top_speed_mps(self, commanded_mps: float) -> float:
        """Return the mean speed that the wheels make of a command, at most."""
        return min(min(commanded_mps, self.max_speed_mps) * self.travel_scale, self.max_speed_mps)

    def disturb(
        self, forward_mps: np.ndarray, turn_radps: np.ndarray, rngs: list[np.random.Generator], robots: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return what the wheels make of twists (k,): no more than the top speed, unequal sides, and noise.

        A robot that is commanded to stand draws noise and stands.
        """
        forward = np.clip(forward_mps, -self.max_speed_mps, self.max_speed_mps) * self.travel_scale
        forward = np.clip(forward, -self.max_speed_mps, self.max_speed_mps)
        # One side's wheels make more way than the other's: the difference turns the robot.
        turn = turn_radps + forward * 2 * (self.side_ratio - 1) / (self.side_ratio + 1) / self.track_m
        noise = np.array([rngs[robot].standard_normal(2) for robot in robots.tolist()]).reshape(-1, 2)
        moves = (forward_mps != 0) | (turn_radps != 0)
        return (
            forward + np.where(moves, self.speed_noise_mps * noise[:, 0], 0.0),
            turn + np.where(moves, self.turn_noise_radps * noise[:, 1], 0.0),
        )

    def controls(self, forward_mps: np.ndarray, turn_radps: np.ndarray) -> np.ndarray:
        """Return the wheels' speeds (k, 4), rad/s, of twists (k,), in the order of the file's actuators."""
        half = turn_radps * self.turn_gain * self.track_m / 2
        left, right = (forward_mps - half) / self.wheel_radius_m, (forward_mps + half) / self.wheel_radius_m
        return np.column_stack([left, right, left, right])

    def attach(self, spec: mujoco.MjSpec, name: str) -> None:
        """Add the robot to a world; floors that have priority over wheels give as tyres do, as wheels do on others."""
        attach_file(spec, "husky.xml", name)
        for wheel in _WHEELS:
            spec.geom(f"{name}_{wheel}").solref = [_TYRE_S, 1.0]
        for geom in spec.geoms:
            if is_floor(geom.name):
                geom.solref = [_TYRE_S, 1.0]
