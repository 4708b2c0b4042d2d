"""The ROS 2 messages of every recording: clock, transforms and odometry; sensors state theirs themselves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from minexplore.sensing.mount import Pose3D
from minexplore.sensors.ros import Message, MessageType, RosMessage, header_of, rotation_of, stamp_of, vector_of

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
