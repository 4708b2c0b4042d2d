"""A recording as MCAP with ROS 2 messages, which `ros2 bag`, Foxglove and `rosbags` open."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from minexplore.extra.record.episode import SensedStep, composed, inverse
from minexplore.sensing.mount import Pose3D
from minexplore.sensors.ros import Message, MessageType, RosMessage, header_of, rotation_of, stamp_of, vector_of
from minexplore.sensors.suite import SensorSuite

_CLOCK = MessageType("rosgraph_msgs/msg/Clock", "builtin_interfaces/Time clock")
_TRANSFORMS = MessageType(
    "tf2_msgs/msg/TFMessage",
    "geometry_msgs/TransformStamped[] transforms",
    (
        *("geometry_msgs/TransformStamped", "std_msgs/Header", "geometry_msgs/Transform"),
        *("geometry_msgs/Vector3", "geometry_msgs/Quaternion"),
    ),
)
_ODOMETRY = MessageType(
    "nav_msgs/msg/Odometry",
    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
    "geometry_msgs/TwistWithCovariance twist",
    (
        *("std_msgs/Header", "geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose", "geometry_msgs/Point"),
        *("geometry_msgs/Quaternion", "geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist"),
        "geometry_msgs/Vector3",
    ),
)


def clock_of(time_ns: int) -> RosMessage:
    """Return the time."""
    return RosMessage("/clock", _CLOCK, {"clock": stamp_of(time_ns)})


def transforms_of(time_ns: int, poses: Sequence[tuple[str, str, Pose3D]]) -> RosMessage:
    """Return transforms, each a parent frame, a child frame, and the child's pose in the parent's frame."""
    transforms: list[Message] = [
        {
            "header": header_of(time_ns, parent),
            "child_frame_id": child,
            "transform": {"translation": vector_of(pose.place_m), "rotation": rotation_of(pose.axes)},
        }
        for parent, child, pose in poses
    ]
    return RosMessage("/tf", _TRANSFORMS, {"transforms": transforms})


def odometry_of(time_ns: int, pose: Pose3D, speed_mps: np.ndarray, turn_radps: float) -> RosMessage:
    """Return the counted pose of `base_link` in `odom`, and the speed (3,) and turn rate, in the robot's frame."""
    nothing = [0.0] * 36
    placed = {"position": vector_of(pose.place_m), "orientation": rotation_of(pose.axes)}
    moving = {"linear": vector_of(speed_mps), "angular": vector_of(np.array([0, 0, turn_radps]))}
    content = {
        **{"header": header_of(time_ns, "odom"), "child_frame_id": "base_link"},
        **{"pose": {"pose": placed, "covariance": nothing}, "twist": {"twist": moving, "covariance": nothing}},
    }
    return RosMessage("/odom", _ODOMETRY, content)


_PACKAGES = ("mcap", "mcap_ros2")


def require_mcap() -> None:
    """Refuse to record where MCAP's packages are missing.

    Raises
    ------
    ImportError
        Naming the extra that brings them.
    """
    if any(find_spec(package) is None for package in _PACKAGES):
        raise ImportError("record needs MCAP's packages: pip install mcap mcap-ros2-support")


def require_new(path: Path) -> None:
    """Refuse to write where something is.

    Raises
    ------
    ValueError
        Naming the path.
    """
    if path.is_dir():
        raise ValueError(f"out = {str(path)!r}: cannot be written (Is a directory)")
    if os.path.lexists(path):
        raise ValueError(f"out = {str(path)!r}: there is a file; move it away, or give another name")


class McapFile:
    """Writes frames. Topics: /clock, /tf, /odom, and those of the sensors.

    Frames of `tf`: `map` is the mine frame; `odom` is where the counted poses are, placed so that `base_link`, on the
    floor under the robot's middle, is at its true place in `map`; the frames of sensors are on it.
    """

    def __init__(self, path: Path, suite: SensorSuite) -> None:
        """Create the file under a temporary name, which `close` changes; `suite` knows how the sensors are mounted.

        Raises
        ------
        ValueError
            If the file cannot be written, or there is one.
        """
        from mcap_ros2.writer import Writer  # of the extra `record`

        require_new(path)
        self._suite, self._path = suite, path
        self._partial = path.with_name(f".{path.name}.{secrets.token_hex(4)}.partial")
        with self._writing():
            self._stream = self._partial.open("xb")
        self._time_ns = 0
        self._schemas: dict[str, Any] = {}  # by the name of the message type
        try:
            with self._writing():
                self._writer: Any = Writer(self._stream)
        except ValueError:
            self.drop()
            raise

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Refuse what the disk does not take, with the file's name."""
        try:
            yield
        except OSError as error:
            raise ValueError(f"out = {str(self._path)!r}: cannot be written ({error.strerror})") from error

    def add(self, frame: SensedStep) -> None:
        """Write one control step."""
        time_ns = self._time_ns = frame.time_ns
        self._write(clock_of(time_ns))
        self._write(transforms_of(time_ns, self._poses(frame)))
        self._write(odometry_of(time_ns, frame.counted, frame.speed_mps, frame.turn_radps))
        for name, reading in frame.readings.items():
            for message in self._suite.sensor(name).messages(name, time_ns, reading):
                self._write(message)

    def _poses(self, frame: SensedStep) -> list[tuple[str, str, Pose3D]]:
        """Return the frames of a step: those of the sensors that it reads, too."""
        sensors = {
            child: pose for name in frame.readings for child, pose in self._suite.sensor(name).frames(name).items()
        }
        return [
            ("map", "odom", composed(frame.robot, inverse(frame.counted))),
            ("odom", "base_link", frame.counted),
            *(("base_link", child, pose) for child, pose in sensors.items()),
        ]

    def _write(self, message: RosMessage) -> None:
        name = message.type.name
        with self._writing():
            if name not in self._schemas:
                self._schemas[name] = self._writer.register_msgdef(name, message.type.definition)
            schema, time_ns = self._schemas[name], self._time_ns
            self._writer.write_message(message.topic, schema, message.content, time_ns, time_ns)

    def close(self) -> None:
        """Write the index, close the file and give it its name.

        Raises
        ------
        ValueError
            If the disk does not take it.
        """
        with self._writing():
            self._writer.finish()
            self._stream.close()
            self._partial.replace(self._path)

    def drop(self) -> None:
        """Remove the file that was not finished; nothing happens after `close`."""
        with suppress(OSError):  # what is buffered finds no place on a full disk
            self._stream.close()
        self._partial.unlink(missing_ok=True)
