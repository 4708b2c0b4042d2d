"""The images of a camera on a robot: colour, depth and labels."""

from __future__ import annotations

from collections.abc import Iterator

import gymnasium
import numpy as np

from minexplore.pictures.cameras import CameraParams, RobotCamera
from minexplore.sensing.image_degradation import degrade_depth, degrade_picture
from minexplore.sensing.mount import Mount, Pose3D
from minexplore.sensing.scanners.labels import LABELS
from minexplore.sensors.kind import SensorKind
from minexplore.sensors.ros import Message, MessageType, RosMessage, header_of
from minexplore.sensors.sensed_robot import SensedRobot

_GIVES = {"rgb": "the picture", "depth": "the depths, m", "labels": "the labels"}
_FRAME = "camera_optical"
# ROS's optical frames look along z, with x to the right: the camera's own axes here are x ahead, y left, z up.
_OPTICAL_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_IMAGE = MessageType(
    "sensor_msgs/msg/Image",
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n"
    "uint8[] data",
    ("std_msgs/Header",),
)
_INFO = MessageType(
    "sensor_msgs/msg/CameraInfo",
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n"
    "float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi",
    ("std_msgs/Header", "sensor_msgs/RegionOfInterest"),
)


class Camera(SensorKind):
    """One camera, whose images are `rgb`, `depth` and `labels`; `params` says how it sees and where it is."""

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Return the names of its images."""
        return tuple(_GIVES)

    @classmethod
    def space(cls, name: str) -> gymnasium.spaces.Box:
        """Return the space of an image; depths may read twice the farthest, by their noise."""
        camera = CameraParams()
        size = camera.height_px, camera.width_px
        if name == "rgb":
            return gymnasium.spaces.Box(0, 255, (*size, 3), np.uint8)
        if name == "labels":
            return gymnasium.spaces.Box(0, len(LABELS) - 1, size, np.uint8)
        return gymnasium.spaces.Box(0, 2 * camera.depth_m, size, np.float32)

    @classmethod
    def gives(cls, name: str) -> str:
        """Return what `capture` gives."""
        return _GIVES[name]

    def __init__(self, robot: SensedRobot) -> None:
        """Take the robot."""
        super().__init__(robot)
        self.params = CameraParams.on(robot.robots.robot)
        self._camera: RobotCamera | None = None

    def read(self, name: str, rng: np.random.Generator) -> np.ndarray:
        """Return an image (h, w) or (h, w, 3)."""
        robot, own = self.robot, self.params
        view = robot.drawing()
        if self._camera is None:
            self._camera = RobotCamera(robot.robots.world, view, own)
        camera, params, pose = self._camera, robot.params, robot.world_pose()
        qpos = robot.robots.qpos[robot.row, None] if view.robots == 1 else robot.robots.qpos
        if name == "labels":
            return camera.labels(qpos, pose)
        if name == "depth":
            depth = camera.depth(qpos, pose)
            if params.is_ideal:
                return depth
            labels = camera.labels(qpos, pose) if params.film_share else np.zeros(depth.shape, np.uint8)
            return degrade_depth(depth, labels, own.focal_px, own.baseline_m, params, rng, own.depth_m)
        picture = camera.colour(qpos, pose)
        if params.is_ideal:
            return picture
        far = camera.depth(qpos, pose) if params.dust_per_m else None
        if far is not None:
            far = np.where(far > 0, far, own.depth_m)
        return degrade_picture(picture, far, params, rng)

    def mount(self, name: str) -> Mount:
        """Return where the camera is on the robot."""
        return self.params.mount

    def frames(self, name: str) -> dict[str, Pose3D]:
        """Return the optical frame."""
        camera = self.params.mount.on(Pose3D(np.zeros(3), np.eye(3)))
        return {_FRAME: Pose3D(camera.place_m, camera.axes @ _OPTICAL_AXES)}

    def messages(self, name: str, time_ns: int, reading: np.ndarray) -> Iterator[RosMessage]:
        """Return an image and its calibration: colours as rgb8, depths, m, as 32FC1, labels as mono8."""
        encoding = "rgb8" if reading.ndim == 3 else {"f": "32FC1", "u": "mono8"}[reading.dtype.kind]
        height, width = reading.shape[:2]
        image = {
            **{"header": header_of(time_ns, _FRAME), "height": height, "width": width, "encoding": encoding},
            **{"is_bigendian": 0, "step": reading.nbytes // height, "data": reading.tobytes()},
        }
        yield RosMessage(f"/camera/{name}/image", _IMAGE, image)
        yield RosMessage(f"/camera/{name}/camera_info", _INFO, self._calibration(time_ns))

    def _calibration(self, time_ns: int) -> Message:
        """Return the calibration of a camera without distortion."""
        width_px, height_px, focal_px = self.params.width_px, self.params.height_px, self.params.focal_px
        # Pixels have whole numbers at their centres, in ROS as in OpenCV.
        k = [focal_px, 0.0, (width_px - 1) / 2, 0.0, focal_px, (height_px - 1) / 2, 0.0, 0.0, 1.0]
        roi = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
        return {
            **{"header": header_of(time_ns, _FRAME), "height": height_px, "width": width_px},
            **{"distortion_model": "plumb_bob", "d": [0.0] * 5, "k": k, "r": np.eye(3).ravel().tolist()},
            **{"p": [*k[:3], 0.0, *k[3:6], 0.0, *k[6:], 0.0], "binning_x": 0, "binning_y": 0, "roi": roi},
        }

    def close(self) -> None:
        """Free the renderer."""
        if self._camera is not None:
            self._camera.close()
            self._camera = None
