"""A recording as MCAP with ROS 2 messages, which `ros2 bag`, Foxglove and `rosbags` open."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from minexplore.envs.sensed.sensor_suite import CAMERA_IMAGES, SensorSuite
from minexplore.record.episode import SensedStep, composed, inverse
from minexplore.record.ros_messages import (
    OPTICAL_AXES,
    Message,
    camera_info_of,
    cloud_of,
    definition_of,
    image_of,
    imu_of,
    message_types,
    odometry_of,
    stamp_of,
    transform_of,
)
from minexplore.sensing.scanners import Mount, Pose3D

_CAMERA = "camera_optical"
_PACKAGES = ("mcap", "mcap_ros2")


def require_mcap() -> None:
    """Refuse to record where MCAP's packages are missing.

    Raises
    ------
    ImportError
        Naming the extra that brings them.
    """
    if any(find_spec(package) is None for package in _PACKAGES):
        raise ImportError("record needs MCAP's packages: pip install 'minexplore[record]'")


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
    """Writes frames. Topics: /clock, /tf, /odom, /imu, /camera/*, and one for each LiDAR.

    Frames of `tf`: `map` is the mine frame; `odom` is where the counted poses are, placed so that `base_link`, on the
    floor under the robot's middle, is at its true place in `map`; LiDARs and the camera's optical frame are on it.
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
        try:
            with self._writing():
                self._writer: Any = Writer(self._stream)
                self._schemas = {k: self._writer.register_msgdef(k, definition_of(k)) for k in message_types()}
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
        self._time_ns = frame.time_ns
        self._write("/clock", "rosgraph_msgs/msg/Clock", {"clock": stamp_of(frame.time_ns)})
        self._write("/tf", "tf2_msgs/msg/TFMessage", {"transforms": self._transforms(frame)})
        odometry = odometry_of(frame.time_ns, frame.counted, frame.speed_mps, frame.turn_radps)
        self._write("/odom", "nav_msgs/msg/Odometry", odometry)
        for name, reading in frame.readings.items():
            self._add_reading(frame.time_ns, name, reading)

    def _add_reading(self, time_ns: int, name: str, reading: Any) -> None:
        if name == "imu":
            self._write("/imu", "sensor_msgs/msg/Imu", imu_of(time_ns, "base_link", reading))
        elif name in CAMERA_IMAGES:
            camera = self._suite.camera
            info = camera_info_of(time_ns, _CAMERA, camera.width_px, camera.height_px, camera.focal_px)
            self._write(f"/camera/{name}/image", "sensor_msgs/msg/Image", image_of(time_ns, _CAMERA, reading))
            self._write(f"/camera/{name}/camera_info", "sensor_msgs/msg/CameraInfo", info)
        else:
            frame = topic_of(name)
            self._write(f"/{frame}/points", "sensor_msgs/msg/PointCloud2", cloud_of(time_ns, frame, reading))

    def _transforms(self, frame: SensedStep) -> list[Message]:
        """Return the transforms of a step: the frames of the sensors that it reads, too."""
        time_ns = frame.time_ns
        corrected = composed(frame.robot, inverse(frame.counted))
        camera = pose_of(self._suite.camera.mount)
        optical = Pose3D(camera.place_m, camera.axes @ OPTICAL_AXES)
        scanners = [name for name in frame.readings if name != "imu" and name not in CAMERA_IMAGES]
        return [
            transform_of(time_ns, "map", "odom", corrected),
            transform_of(time_ns, "odom", "base_link", frame.counted),
            transform_of(time_ns, "base_link", _CAMERA, optical),
            *(
                transform_of(time_ns, "base_link", topic_of(name), pose_of(self._suite.scanner(name).mount))
                for name in scanners
            ),
        ]

    def _write(self, topic: str, message_type: str, message: Message) -> None:
        with self._writing():
            self._writer.write_message(topic, self._schemas[message_type], message, self._time_ns, self._time_ns)

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


def topic_of(scanner: str) -> str:
    """Return the frame and the topic of a LiDAR: ROS's names have no hyphens."""
    return scanner.replace("-", "_")


def pose_of(mount: Mount) -> Pose3D:
    """Return the pose of a mount in the robot's frame."""
    return mount.on(Pose3D(np.zeros(3), np.eye(3)))
