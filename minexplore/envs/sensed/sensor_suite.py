"""The sensors of one robot in an environment: made when they are first used, read when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import numpy as np

from minexplore.envs.robot_batch import RobotBatch
from minexplore.pictures.cameras import CameraParams, RobotCamera
from minexplore.pictures.render import Renderer
from minexplore.rotations import rotate_inverse, rotation_matrices
from minexplore.sensing.image_degradation import degrade_depth, degrade_picture
from minexplore.sensing.imu import Imu
from minexplore.sensing.lidar import Backend
from minexplore.sensing.params import SensorParams
from minexplore.sensing.scanners import (
    LABELS,
    Mount,
    PointCloud,
    Pose3D,
    Scanner,
    load_pattern,
    pattern_names,
    scanner_of,
)

CAMERA_IMAGES = ("rgb", "depth", "labels")
_SALT = 0x5E450  # keeps the sensors' random numbers apart from the episode's
_IMU_MOST = np.array([35.0] * 3 + [235.0] * 3, dtype=np.float32)  # Bosch BMI088: 2,000 deg/s and 24 g
_ABOVE_SCANNER_M = 0.05  # of a LiDAR in three dimensions, over the robot's own


def sensor_names() -> list[str]:
    """Return the names of all sensors."""
    return [*CAMERA_IMAGES, "imu", *pattern_names()]


def check_sensors(names: Any) -> tuple[str, ...]:
    """Return the names of sensors as a tuple.

    Raises
    ------
    ValueError
        If they are no sequence of known names, each once.
    """
    known = sensor_names()
    if isinstance(names, str) or not isinstance(names, Sequence):
        raise ValueError(f"sensors = {names!r:.100}: want a list of {', '.join(known)}")
    for name in names:
        if name not in known or list(names).count(name) > 1:
            raise ValueError(f"sensors: {name!r:.100}: want each once of {', '.join(known)}")
    return tuple(names)


def observed_space(own: gymnasium.spaces.Box, names: Sequence[str]) -> gymnasium.spaces.Space:
    """Return the space of an observation: a robot's own, or with sensors a dict that holds it as `robot`."""
    return gymnasium.spaces.Dict({"robot": own, **{name: sensor_space(name) for name in names}}) if names else own


def sensor_space(name: str) -> gymnasium.spaces.Box:
    """Return the space of a sensor in an observation: images, ranges of all rays (0: no return), or readings."""
    camera = CameraParams()
    size = camera.height_px, camera.width_px
    if name == "rgb":
        return gymnasium.spaces.Box(0, 255, (*size, 3), np.uint8)
    if name == "labels":
        return gymnasium.spaces.Box(0, len(LABELS) - 1, size, np.uint8)
    if name == "depth":
        return gymnasium.spaces.Box(0, 2 * camera.depth_m, size, np.float32)
    if name == "imu":
        return gymnasium.spaces.Box(-_IMU_MOST, _IMU_MOST, dtype=np.float32)
    pattern = load_pattern(name)
    return gymnasium.spaces.Box(0, pattern.range_m[1], (pattern.rays,), np.float32)


class SensorSuite:
    """Reads sensors of the first robot of a batch."""

    def __init__(
        self, robots: RobotBatch, drawing: Callable[[], Renderer], params: SensorParams, backend: Backend = "auto"
    ) -> None:
        """Take the robots and what draws their world; sensors cost nothing before they are read."""
        self.params, self.camera = params, CameraParams.on(robots.robot)
        self._robots, self._drawing, self._backend = robots, drawing, backend
        self._scanners: dict[str, Scanner] = {}
        self._camera: RobotCamera | None = None
        self._imu = Imu(params, robots.task.control_s)
        self._scan = 0
        self._rng = np.random.default_rng(_SALT)

    def use(self, params: SensorParams) -> None:
        """Take other parameters, from the next reading on; an IMU keeps its bias."""
        self.params, self._scanners = params, {}
        self._imu.params = params

    def begin(self, seed: int | None) -> None:
        """Begin an episode; with a seed its random numbers are those of the seed."""
        if seed is not None:
            self._rng = np.random.default_rng([seed, _SALT])
        self._scan = 0
        self._imu.begin(self._rng, self._robots.qvel[0, :3])

    def advance(self) -> None:
        """Take the end of a control step."""
        self._imu.advance(self._robots.qvel[0, :3])

    def observe(self, name: str) -> np.ndarray:
        """Return a sensor's reading as an array of its space."""
        reading = self.capture(name)
        if isinstance(reading, PointCloud):
            return reading.ranges_m()
        space = sensor_space(name)
        return np.clip(reading, space.low, space.high).astype(space.dtype)

    def capture(self, name: str) -> Any:
        """Return a sensor's reading: an image, a `PointCloud`, or turn rates and forces (6,)."""
        if name == "imu":
            return self._read_imu()
        if name in CAMERA_IMAGES:
            return self._look(name)
        self._scan += 1
        return self.scanner(name).scan(self.robot_pose(), self._rng, self._scan - 1)

    def scanner(self, name: str) -> Scanner:
        """Return a LiDAR by its name, on top of the robot's own."""
        if name not in self._scanners:
            mount = Mount(height_m=self._robots.robot.top_m + _ABOVE_SCANNER_M)
            self._scanners[name] = scanner_of(name, self._robots.world, mount, self.params, self._backend)
        return self._scanners[name]

    def robot_pose(self) -> Pose3D:
        """Return the robot's pose in the mine frame, its origin on the floor or at a guard's lower edge."""
        axes = rotate_inverse(rotation_matrices(self._robots.qpos[:1, 3:7])[0].T, self._robots.T_world_mine[:3, :3]).T
        turn, shift = self._robots.T_world_mine[:3, :3], self._robots.T_world_mine[:3, 3]
        place = rotate_inverse(self._robots.qpos[:1, :3] - shift, turn)[0]
        return Pose3D(place - self._robots.robot.origin_height_m * axes[:, 2], axes)

    def _world_pose(self) -> Pose3D:
        """Return the same pose in the world frame, in which MuJoCo draws."""
        axes = rotation_matrices(self._robots.qpos[:1, 3:7])[0]
        return Pose3D(self._robots.qpos[0, :3] - self._robots.robot.origin_height_m * axes[:, 2], axes)

    def _read_imu(self) -> np.ndarray:
        axes, speed = rotation_matrices(self._robots.qpos[:1, 3:7])[0], self._robots.qvel[0]
        reading = self._imu.read(axes, speed[3:6], self._rng)
        return np.concatenate([reading.gyro_radps, reading.force_mps2])

    def _look(self, name: str) -> np.ndarray:
        if self._camera is None:
            self._camera = RobotCamera(self._robots.world, self._drawing(), self.camera)
        camera, params, qpos, pose = self._camera, self.params, self._robots.qpos, self._world_pose()
        own = self.camera
        if name == "labels":
            return camera.labels(qpos, pose)
        if name == "depth":
            depth = camera.depth(qpos, pose)
            if params.is_ideal:
                return depth
            labels = camera.labels(qpos, pose) if params.film_share else np.zeros(depth.shape, np.uint8)
            return degrade_depth(depth, labels, own.focal_px, own.baseline_m, params, self._rng, own.depth_m)
        picture = camera.colour(qpos, pose)
        if params.is_ideal:
            return picture
        far = camera.depth(qpos, pose) if params.dust_per_m else None
        if far is not None:
            far = np.where(far > 0, far, own.depth_m)
        return degrade_picture(picture, far, params, self._rng)

    def copy_state(self) -> dict[str, Any]:
        """Return what changes while the robot drives."""
        return {"rng": self._rng, "scan": self._scan, "imu": self._imu}

    def restore_state(self, state: dict[str, Any]) -> None:
        """Take what `copy_state` returned."""
        self._rng, self._scan, self._imu = state["rng"], state["scan"], state["imu"]

    def close(self) -> None:
        """Free the camera."""
        if self._camera is not None:
            self._camera.close()
            self._camera = None
