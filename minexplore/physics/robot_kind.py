"""What environments need of any robot's parameters."""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Container
from pathlib import Path
from typing import ClassVar

import mujoco
import numpy as np

_FILES = Path(__file__).parent / "mjcf"
LAMP_ABOVE_M = 0.05  # a headlamp is on top of the scanner
_NARROWEST = 0.2  # of a wheel's radius, half its width where the wheels themselves stand out of the disc


class Robot(ABC):
    """A kind of robot: its parameters are a frozen dataclass that inherits from this.

    `COMMANDS` numbers in [-1, 1] drive it, `JOINTS` are its joints in the order of `qpos`, without the robot's name.
    `SIDES` are the geoms of its wheels, left and right ones.
    """

    KIND: ClassVar[str] = "differential drive"
    COMMANDS: ClassVar[int] = 2
    FLIES: ClassVar[bool] = False
    JOINTS: ClassVar[tuple[str, ...]] = ("free", "left", "right")
    SIDES: ClassVar[tuple[tuple[str, ...], tuple[str, ...]]] = (("left",), ("right",))

    radius_m: float
    sensor_height_m: float
    scanner_radius_m: float
    scanner_height_m: float
    wheel_radius_m: float
    wheel_base_m: float

    @property
    @abstractmethod
    def lamp_height_m(self) -> float:
        """Return how high a headlamp is above the origin of the robot's body."""

    @property
    def origin_height_m(self) -> float:
        """Return how high the origin of the robot's body is over the ground that it stands on."""
        return self.wheel_radius_m

    @property
    def top_m(self) -> float:
        """Return how high the top of its scanner is over that ground."""
        return self.sensor_height_m + self.scanner_height_m / 2

    @property
    def camera_m(self) -> tuple[float, float]:
        """Return how far ahead of the body's origin, and how high over that ground, a camera is."""
        return 0.36, 0.5

    @property
    def between_sides_m(self) -> float:
        """Return how far the wheels of both sides are apart; a robot without wheels has no odometry."""
        return self.wheel_base_m

    @abstractmethod
    def attach(self, spec: mujoco.MjSpec, name: str) -> None:
        """Add the robot to a world as body `name`, with names that begin with it and `_`."""


class DrivenRobot(Robot):
    """A kind of robot that twists drive."""

    @abstractmethod
    def controls(self, forward_mps: np.ndarray, turn_radps: np.ndarray) -> np.ndarray:
        """Return the actuators' controls (k, actuators) of twists (k,)."""

    def disturb(
        self, forward_mps: np.ndarray, turn_radps: np.ndarray, rngs: list[np.random.Generator], robots: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the twists (k,) that robots (k,) make of commanded ones; each draws from its own generator."""
        return forward_mps, turn_radps

    def top_speed_mps(self, commanded_mps: float) -> float:
        """Return the mean speed that the wheels make of a command, at most."""
        return commanded_mps


def check_measures(kind: str, params: Robot, free: Container[str]) -> None:
    """Refuse other values of fields that hold the measures of a robot's MJCF file: all but the `free` ones.

    Raises
    ------
    ValueError
        Naming the kind, the field, its value and the file's.
    """
    for field in dataclasses.fields(params):  # type: ignore[arg-type]
        value = getattr(params, field.name)
        if field.name not in free and value != field.default:
            raise ValueError(
                f"{kind}: {field.name} = {value!r:.100}: want {field.default}, the measure of its MJCF file"
            )


def attach_file(spec: mujoco.MjSpec, file: str, name: str) -> mujoco.MjsBody:
    """Add a robot of this package's MJCF to a world; its body `base` becomes `name`."""
    robot = mujoco.MjSpec.from_file(str(_FILES / file))
    spec.attach(robot, prefix=f"{name}_", frame=spec.worldbody.add_frame())
    body = spec.body(f"{name}_base")
    body.name = name
    return body


def keep_in_disc(wheel: mujoco.MjsGeom, radius_m: float) -> None:
    """Make a wheel that is a sphere an ellipsoid that does not stand out of the robot's disc.

    Walls of a volume stop wheels too, as these climb what is low of a wall: a sphere touched walls that the disc, by
    which maps say where robots fit, was 8 cm away from, and the wheel drove up them. On a floor both touch one point.
    """
    ahead, beside, _ = np.abs(wheel.parent.pos)
    round_m = wheel.size[0]
    room_m = math.sqrt(max(radius_m**2 - ahead**2, 0.0)) - beside
    if wheel.type == mujoco.mjtGeom.mjGEOM_SPHERE and room_m < round_m:
        wheel.type = mujoco.mjtGeom.mjGEOM_ELLIPSOID
        wheel.size = [round_m, max(room_m, _NARROWEST * round_m), round_m]
