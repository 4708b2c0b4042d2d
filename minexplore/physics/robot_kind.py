"""What environments need of any robot's parameters."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Container
from pathlib import Path
from typing import ClassVar

import mujoco
import numpy as np

_FILES = Path(__file__).parent / "mjcf"


class Robot(ABC):
    """A kind of robot: its parameters are a frozen dataclass that inherits from this.

    `COMMANDS` numbers in [-1, 1] drive it, `JOINTS` are its joints in the order of `qpos`, without the robot's name.
    """

    KIND: ClassVar[str] = "differential drive"
    COMMANDS: ClassVar[int] = 2
    FLIES: ClassVar[bool] = False
    JOINTS: ClassVar[tuple[str, ...]] = ("free", "left", "right")

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
