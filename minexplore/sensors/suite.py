"""The sensors of one robot in an environment: made when one is first read, read when they are asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from minexplore.sensors.sensed_robot import SensedRobot
from minexplore.sensors.table import kinds

if TYPE_CHECKING:
    from collections.abc import Callable

    from minexplore.pictures.render import Renderer
    from minexplore.sensing.lidar import Backend
    from minexplore.sensing.mount import Mount
    from minexplore.sensing.params import SensorParams
    from minexplore.sensors.kind import SensorKind

_SALT = 0x5E450  # keeps the sensors' random numbers apart from the episode's


class SensorSuite(SensedRobot):
    """Reads sensors of a robot of a batch. Sensors cost nothing before one is read."""

    def __init__(
        self, robots: Any, drawing: Callable[[], Renderer], params: SensorParams, backend: Backend = "auto"
    ) -> None:
        """Take what `SensedRobot` does."""
        super().__init__(robots, drawing, params, backend)
        self._rng = np.random.default_rng(_SALT)
        self._by_name: dict[str, SensorKind] | None = None
        self._waiting = 0  # episodes since the last seed that sensors have not begun, as none was there

    def use(self, params: SensorParams) -> None:
        """Take other parameters, from the next reading on; an IMU keeps its bias."""
        self._sensors()
        self.params = params

    def begin(self, seed: int | None) -> None:
        """Begin an episode; with a seed its random numbers are those of the seed."""
        if seed is not None:
            self._rng, self._waiting = np.random.default_rng([seed, _SALT]), 0
        self.before_mps = self.velocity_mps = self.robots.qvel[self.row, :3].copy()
        self._waiting += 1
        if self._by_name is not None:
            self._sensors()

    def advance(self) -> None:
        """Take the end of a control step."""
        self.before_mps, self.velocity_mps = self.velocity_mps, self.robots.qvel[self.row, :3].copy()

    def observe(self, name: str) -> np.ndarray:
        """Return a sensor's reading as an array of its space."""
        return self.sensor(name).observed(name, self.capture(name))

    def capture(self, name: str) -> Any:
        """Return a sensor's reading: an image, a `PointCloud`, or numbers."""
        return self.sensor(name).read(name, self._rng)

    def sensor(self, name: str) -> SensorKind:
        """Return what reads a sensor."""
        return self._sensors()[name]

    def mount(self, name: str) -> Mount:
        """Return where a sensor is on the robot."""
        return self.sensor(name).mount(name)

    def _sensors(self) -> dict[str, SensorKind]:
        """Return all sensors by name, in the present episode."""
        if self._by_name is None:
            self._by_name = {name: sensor for kind in kinds() for sensor in [kind(self)] for name in kind.names()}
        for _ in range(self._waiting):
            for sensor in dict.fromkeys(self._by_name.values()):
                sensor.begin(self._rng)
        self._waiting = 0
        return self._by_name

    def copy_state(self) -> dict[str, Any]:
        """Return what changes while the robot drives."""
        own = {name: getattr(self, name) for name in ("_rng", "_waiting", "before_mps", "velocity_mps")}
        sensors = {
            name: {field: getattr(sensor, field) for field in sensor.CHANGES}
            for name, sensor in (self._by_name or {}).items()
        }
        return {"own": own, "sensors": sensors}

    def restore_state(self, state: dict[str, Any]) -> None:
        """Take what `copy_state` returned."""
        if state["sensors"]:
            for name, sensor in self._sensors().items():
                sensor.__dict__.update(state["sensors"][name])
        self.__dict__.update(state["own"])

    def close(self) -> None:
        """Free what the sensors hold."""
        for sensor in dict.fromkeys((self._by_name or {}).values()):
            sensor.close()
