"""The sensors of each robot of a vector, and their readings in batches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from minexplore.envs.robot_batch import RobotBatch
from minexplore.sensing.lidar import Backend
from minexplore.sensing.params import SensorParams
from minexplore.sensors.suite import SensorSuite
from minexplore.sensors.table import sensor_space

if TYPE_CHECKING:
    from minexplore.pictures.render import Renderer


class SensedRows:
    """Reads sensors of all robots of a batch; robot i reads what it would read alone.

    Parameters
    ----------
    robots : RobotBatch
    names : sequence of str
        Of the sensors that are read at every step.
    drawing, params, backend
        As `minexplore.sensors.sensed_robot.SensedRobot` takes them.
    """

    def __init__(
        self,
        robots: RobotBatch,
        names: Sequence[str],
        drawing: Callable[[], Renderer],
        params: SensorParams,
        backend: Backend,
    ) -> None:
        """Make nothing costly: sensors are made when they are first read."""
        self._suites = [SensorSuite(robots, drawing, params, backend) for _ in range(robots.count)]
        for row, suite in enumerate(self._suites):
            suite.row = row
        spaces = {name: sensor_space(name) for name in names}
        self.readings: dict[str, np.ndarray] = {
            name: np.zeros((robots.count, *space.shape), space.dtype) for name, space in spaces.items()
        }

    def take(self, rows: np.ndarray, seeds: Sequence[int | None] | None = None) -> None:
        """Read the sensors of robots (k,), which begin episodes of `seeds` (n,), or without them have made a step."""
        for row in rows.tolist():
            suite = self._suites[row]
            if seeds is None:
                suite.advance()
            else:
                suite.begin(seeds[row])
            for name, readings in self.readings.items():
                readings[row] = suite.observe(name)

    def copy_state(self) -> dict[str, Any]:
        """Return what changes while robots drive."""
        readings = {name: rows.copy() for name, rows in self.readings.items()}
        return {"suites": [suite.copy_state() for suite in self._suites], "readings": readings}

    def restore_state(self, state: dict[str, Any]) -> None:
        """Take what `copy_state` returned."""
        for suite, own in zip(self._suites, state["suites"], strict=True):
            suite.restore_state(own)
        self.readings = state["readings"]

    def close(self) -> None:
        """Free what sensors hold."""
        for suite in self._suites:
            suite.close()
