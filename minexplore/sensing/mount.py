"""Where a sensor is: on a robot, and with it in the mine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from minexplore.limits import Span, check_numbers

_PLACE, _TURN = Span(-20.0, 20.0), Span(-180.0, 180.0)


@dataclass(frozen=True)
class Pose3D:
    """A place (3,) m and the axes (3, 3) of a frame, in columns, in the mine frame."""

    place_m: np.ndarray
    axes: np.ndarray

    def points(self, points_m: np.ndarray) -> np.ndarray:
        """Return points (n, 3) m of this frame in the mine frame."""
        placed: np.ndarray = points_m @ self.axes.T.astype(points_m.dtype) + self.place_m.astype(points_m.dtype)
        return placed


@dataclass(frozen=True)
class Mount:
    """The pose of a sensor on a robot: m from the floor under the robot's middle, then yaw, pitch (nose down), roll."""

    x_m: float = 0.0
    y_m: float = 0.0
    height_m: float = 0.5
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0

    def __post_init__(self) -> None:
        """Refuse numbers that are no pose."""
        spans = {"x_m": _PLACE, "y_m": _PLACE, "height_m": _PLACE}
        check_numbers("mount", self, {**spans, "yaw_deg": _TURN, "pitch_deg": _TURN, "roll_deg": _TURN})

    def axes(self) -> np.ndarray:
        """Return the sensor's axes (3, 3), in columns, in the robot's frame."""
        yaw, pitch, roll = np.radians([self.yaw_deg, self.pitch_deg, self.roll_deg])
        cy, sy, cp, sp, cr, sr = *_of(yaw), *_of(pitch), *_of(roll)
        about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1.0]])
        about_y = np.array([[cp, 0, sp], [0, 1.0, 0], [-sp, 0, cp]])
        about_x = np.array([[1.0, 0, 0], [0, cr, -sr], [0, sr, cr]])
        turned: np.ndarray = about_z @ about_y @ about_x
        return turned

    def on(self, robot: Pose3D) -> Pose3D:
        """Return the sensor's pose on a robot whose origin is on the floor under its middle."""
        offset = np.array([self.x_m, self.y_m, self.height_m])
        return Pose3D(robot.place_m + robot.axes @ offset, robot.axes @ self.axes())


def _of(angle: float) -> tuple[float, float]:
    return float(np.cos(angle)), float(np.sin(angle))
