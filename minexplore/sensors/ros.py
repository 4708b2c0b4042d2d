"""ROS 2 messages as plain dicts, with the definitions of their types, of which MCAP needs the text.

Definitions are those of builtin_interfaces, geometry_msgs, nav_msgs, rosgraph_msgs, sensor_msgs, std_msgs and tf2_msgs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from minexplore.rotations import quaternion

Message = dict[str, Any]

_PARTS = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform"
    ),
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist\nfloat64[36] covariance",
    "sensor_msgs/PointField": (
        "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\n"
        "uint8 FLOAT32=7\nuint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count"
    ),
    "sensor_msgs/RegionOfInterest": "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify",
}


@dataclass(frozen=True)
class MessageType:
    """A type of messages: its name, its fields as ROS writes them, and the types that these fields have."""

    name: str
    fields: str
    parts: tuple[str, ...] = ()

    @property
    def definition(self) -> str:
        """Return the definition with those of its parts, as rosbag2 stores it in MCAP."""
        return "".join([self.fields, *(f"\n{'=' * 80}\nMSG: {part}\n{_PARTS[part]}" for part in self.parts)])


@dataclass(frozen=True)
class RosMessage:
    """A message on a topic."""

    topic: str
    type: MessageType
    content: Message


def stamp_of(time_ns: int) -> Message:
    """Return a time as ROS states it."""
    return {"sec": time_ns // 1_000_000_000, "nanosec": time_ns % 1_000_000_000}


def header_of(time_ns: int, frame: str) -> Message:
    """Return a header."""
    return {"stamp": stamp_of(time_ns), "frame_id": frame}


def vector_of(values: np.ndarray) -> Message:
    """Return a vector or a point (3,)."""
    return dict(zip("xyz", map(float, values), strict=True))


def rotation_of(axes: np.ndarray) -> Message:
    """Return the rotation of axes (3, 3), in columns."""
    w, x, y, z = map(float, quaternion(np.ascontiguousarray(axes)))
    return {"x": x, "y": y, "z": z, "w": w}
