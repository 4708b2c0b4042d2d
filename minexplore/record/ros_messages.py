"""Definitions of the ROS 2 messages that a recording holds, and how dictionaries of them are made.

The definitions are those of the ROS 2 packages builtin_interfaces, geometry_msgs, nav_msgs, rosgraph_msgs, sensor_msgs,
std_msgs and tf2_msgs.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from minexplore.rotations import quaternion
from minexplore.sensing.scanners import PointCloud, Pose3D

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
_MESSAGES = {
    "rosgraph_msgs/msg/Clock": ("builtin_interfaces/Time clock", ()),
    "tf2_msgs/msg/TFMessage": (
        "geometry_msgs/TransformStamped[] transforms",
        (
            *("geometry_msgs/TransformStamped", "std_msgs/Header", "geometry_msgs/Transform"),
            *("geometry_msgs/Vector3", "geometry_msgs/Quaternion"),
        ),
    ),
    "nav_msgs/msg/Odometry": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
        "geometry_msgs/TwistWithCovariance twist",
        (
            *("std_msgs/Header", "geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose", "geometry_msgs/Point"),
            *("geometry_msgs/Quaternion", "geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist"),
            "geometry_msgs/Vector3",
        ),
    ),
    "sensor_msgs/msg/Imu": (
        "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance",
        ("std_msgs/Header", "geometry_msgs/Quaternion", "geometry_msgs/Vector3"),
    ),
    "sensor_msgs/msg/Image": (
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n"
        "uint8[] data",
        ("std_msgs/Header",),
    ),
    "sensor_msgs/msg/CameraInfo": (
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n"
        "float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi",
        ("std_msgs/Header", "sensor_msgs/RegionOfInterest"),
    ),
    "sensor_msgs/msg/PointCloud2": (
        "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n"
        "uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense",
        ("std_msgs/Header", "sensor_msgs/PointField"),
    ),
}
_FLOATS = ("x", "y", "z", "intensity", "time", "range")
_POINT = np.dtype([*((name, "<f4") for name in _FLOATS), ("ring", "<u2"), ("label", "u1"), ("unused", "u1")])
_FIELDS = [
    *({"name": name, "offset": 4 * number, "datatype": 7, "count": 1} for number, name in enumerate(_FLOATS)),
    {"name": "ring", "offset": 24, "datatype": 4, "count": 1},  # sensor_msgs/PointField's UINT16, UINT8 below
    {"name": "label", "offset": 26, "datatype": 2, "count": 1},
]
# ROS's optical frames look along z, with x to the right: the camera's own axes here are x ahead, y left, z up.
OPTICAL_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def message_types() -> list[str]:
    """Return the names of the message types."""
    return list(_MESSAGES)


def definition_of(message_type: str) -> str:
    """Return a type's definition with those of its parts, as rosbag2 stores it in MCAP."""
    own, parts = _MESSAGES[message_type]
    return "".join([own, *(f"\n{'=' * 80}\nMSG: {part}\n{_PARTS[part]}" for part in parts)])


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


def transform_of(time_ns: int, parent: str, child: str, pose: Pose3D) -> Message:
    """Return one transform of `tf`."""
    moved = {"translation": vector_of(pose.place_m), "rotation": rotation_of(pose.axes)}
    return {"header": header_of(time_ns, parent), "child_frame_id": child, "transform": moved}


def cloud_of(time_ns: int, frame: str, cloud: PointCloud) -> Message:
    """Return a cloud as PointCloud2 with the fields x, y, z, intensity, time, range, ring and label."""
    points = np.zeros(len(cloud), dtype=_POINT)
    places = cloud.points_m
    for axis, name in enumerate("xyz"):
        points[name] = places[:, axis]
    for name, values in (
        *(("intensity", cloud.intensity), ("time", cloud.time_s), ("range", cloud.range_m)),
        *(("ring", cloud.ring), ("label", cloud.label)),
    ):
        points[name] = values
    step = _POINT.itemsize
    return {
        **{"header": header_of(time_ns, frame), "height": 1, "width": len(cloud), "fields": _FIELDS},
        **{"is_bigendian": False, "point_step": step, "row_step": step * len(cloud), "data": points.tobytes()},
        "is_dense": True,
    }


def image_of(time_ns: int, frame: str, pixels: np.ndarray) -> Message:
    """Return an image: colours as rgb8, depths, m, as 32FC1, labels as mono8."""
    encoding = "rgb8" if pixels.ndim == 3 else {"f": "32FC1", "u": "mono8"}[pixels.dtype.kind]
    height, width = pixels.shape[:2]
    return {
        **{"header": header_of(time_ns, frame), "height": height, "width": width, "encoding": encoding},
        **{"is_bigendian": 0, "step": pixels.nbytes // height, "data": pixels.tobytes()},
    }


def camera_info_of(time_ns: int, frame: str, width_px: int, height_px: int, focal_px: float) -> Message:
    """Return the calibration of a camera without distortion."""
    k = [focal_px, 0.0, width_px / 2, 0.0, focal_px, height_px / 2, 0.0, 0.0, 1.0]
    roi = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
    return {
        **{"header": header_of(time_ns, frame), "height": height_px, "width": width_px},
        **{"distortion_model": "plumb_bob", "d": [0.0] * 5, "k": k, "r": np.eye(3).ravel().tolist()},
        **{"p": [*k[:3], 0.0, *k[3:6], 0.0, *k[6:], 0.0], "binning_x": 0, "binning_y": 0, "roi": roi},
    }


def imu_of(time_ns: int, frame: str, reading: np.ndarray) -> Message:
    """Return turn rates and forces (6,); the orientation is not measured, which ROS states by a -1."""
    unknown, nothing = [-1.0, *[0.0] * 8], [0.0] * 9
    return {
        **{"header": header_of(time_ns, frame), "orientation": rotation_of(np.eye(3))},
        **{"orientation_covariance": unknown, "angular_velocity": vector_of(reading[:3])},
        **{"angular_velocity_covariance": nothing, "linear_acceleration": vector_of(reading[3:])},
        "linear_acceleration_covariance": nothing,
    }


def odometry_of(time_ns: int, pose: Pose3D, speed_mps: np.ndarray, turn_radps: float) -> Message:
    """Return the counted pose of `base_link` in `odom`, and the speed (3,) and turn rate, in the robot's frame."""
    nothing = [0.0] * 36
    placed = {"position": vector_of(pose.place_m), "orientation": rotation_of(pose.axes)}
    moving = {"linear": vector_of(speed_mps), "angular": vector_of(np.array([0, 0, turn_radps]))}
    return {
        **{"header": header_of(time_ns, "odom"), "child_frame_id": "base_link"},
        **{"pose": {"pose": placed, "covariance": nothing}, "twist": {"twist": moving, "covariance": nothing}},
    }
