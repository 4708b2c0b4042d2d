"""The clouds of LiDARs in three dimensions, one for each pattern that ships with the package."""

from __future__ import annotations

from collections.abc import Iterator

import gymnasium
import numpy as np

from minexplore.sensing.mount import Mount, Pose3D
from minexplore.sensing.params import SensorParams
from minexplore.sensing.scanners import PointCloud, Scanner, load_pattern, pattern_names, scanner_of
from minexplore.sensors.kind import SensorKind
from minexplore.sensors.ros import MessageType, RosMessage, header_of
from minexplore.sensors.sensed_robot import SensedRobot

_ABOVE_SCANNER_M = 0.05  # over the robot's own scanner
_MESSAGE = MessageType(
    "sensor_msgs/msg/PointCloud2",
    "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n"
    "uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense",
    ("std_msgs/Header", "sensor_msgs/PointField"),
)
_FLOATS = ("x", "y", "z", "intensity", "time", "range")
_POINT = np.dtype([*((name, "<f4") for name in _FLOATS), ("ring", "<u2"), ("label", "u1"), ("unused", "u1")])
_FIELDS = [
    *({"name": name, "offset": 4 * number, "datatype": 7, "count": 1} for number, name in enumerate(_FLOATS)),
    {"name": "ring", "offset": 24, "datatype": 4, "count": 1},  # sensor_msgs/PointField's UINT16, UINT8 below
    {"name": "label", "offset": 26, "datatype": 2, "count": 1},
]


class Lidar3D(SensorKind):
    """The LiDARs, each on top of the robot's own scanner; one scan a reading."""

    CHANGES = ("_scans",)

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Return the names of the patterns."""
        return tuple(pattern_names())

    @classmethod
    def space(cls, name: str) -> gymnasium.spaces.Box:
        """Return the space of the ranges of all rays, m; 0 means no return."""
        pattern = load_pattern(name)
        return gymnasium.spaces.Box(0, pattern.range_m[1], (pattern.rays,), np.float32)

    @classmethod
    def gives(cls, name: str) -> str:
        """Return what `capture` gives."""
        return "a `PointCloud`; the observation holds the ranges of all rays, 0 for none"

    def __init__(self, robot: SensedRobot) -> None:
        """Take the robot."""
        super().__init__(robot)
        self._scanners: dict[tuple[str, SensorParams], Scanner] = {}
        self._scans = 0  # of all LiDARs in this episode

    def begin(self, rng: np.random.Generator) -> None:
        """Count scans from 0."""
        self._scans = 0

    def read(self, name: str, rng: np.random.Generator) -> PointCloud:
        """Return the cloud of a scan."""
        key, batch = (name, self.robot.params), self.robot.robots
        if key not in self._scanners:
            scanner = scanner_of(name, batch.world, self.mount(name), self.robot.params, self.robot.backend)
            scanner.caster = batch.surfaces_round(self.robot.row, scanner.caster)
            self._scanners[key] = scanner
        self._scans += 1
        return self._scanners[key].scan(self.robot.pose(), rng, self._scans - 1)

    def observed(self, name: str, reading: PointCloud) -> np.ndarray:
        """Return the ranges of all rays."""
        return reading.ranges_m()

    def mount(self, name: str) -> Mount:
        """Return where a LiDAR is on the robot."""
        return Mount(height_m=self.robot.robots.robot.top_m + _ABOVE_SCANNER_M)

    def frames(self, name: str) -> dict[str, Pose3D]:
        """Return the LiDAR's frame."""
        return {_frame_of(name): self.mount(name).on(Pose3D(np.zeros(3), np.eye(3)))}

    def messages(self, name: str, time_ns: int, reading: PointCloud) -> Iterator[RosMessage]:
        """Return the cloud as PointCloud2 with the fields x, y, z, intensity, time, range, ring and label."""
        points = np.zeros(len(reading), dtype=_POINT)
        places = reading.points_m
        for axis, field in enumerate("xyz"):
            points[field] = places[:, axis]
        for field, values in (
            *(("intensity", reading.intensity), ("time", reading.time_s), ("range", reading.range_m)),
            *(("ring", reading.ring), ("label", reading.label)),
        ):
            points[field] = values
        frame, step = _frame_of(name), _POINT.itemsize
        content = {
            **{"header": header_of(time_ns, frame), "height": 1, "width": len(reading), "fields": _FIELDS},
            **{"is_bigendian": False, "point_step": step, "row_step": step * len(reading), "data": points.tobytes()},
            "is_dense": True,
        }
        yield RosMessage(f"/{frame}/points", _MESSAGE, content)


def _frame_of(name: str) -> str:
    """Return the frame and the topic of a LiDAR: ROS's names have no hyphens."""
    return name.replace("-", "_")
