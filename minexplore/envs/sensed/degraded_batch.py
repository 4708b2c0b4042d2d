"""Robots whose own beams are degraded by dust, water and grazing incidence."""

from __future__ import annotations

from typing import Any

import numpy as np

from minexplore.envs.flyer_batch import FlyerBatch
from minexplore.envs.robot_batch import RobotBatch
from minexplore.envs.sensed.odometry_batch import OdometryBatch
from minexplore.physics.robot_kind import Robot
from minexplore.sensing.params import SensorParams
from minexplore.sensing.scanners.caster import Hits, shared_caster
from minexplore.sensing.scanners.degradation import degrade_hits
from minexplore.sensing.scanners.pattern import ScanPattern
from minexplore.tasks.exploration import StepOutcome
from minexplore.tasks.starts import EpisodeStart, source_of

# Of a SICK TiM551's range of 10 m (SICKAG/sick_scan_xd, list of devices). Not verified: 8 m at 10 % remission.
_TEN_PERCENT_SHARE = 0.8


class DegradedBatch(RobotBatch):
    """As `RobotBatch`, but beams return from dust, or not at all, as `SensorParams` say.

    A beam without a return reads the farthest range, as of such LiDARs' drivers, and sees no cell. A beam sees cells on
    its way to its return, no farther than the rock. The task's own noise is added as ever.
    """

    def __init__(self, *arguments: Any, conditions: SensorParams, **named: Any) -> None:
        """Take the arguments of `RobotBatch` beside the conditions."""
        super().__init__(*arguments, **named)
        near_m, far_m = self.task.range_m
        self._conditions = conditions
        self._surfaces = shared_caster(self.world, far_m)
        self._pattern = ScanPattern(
            name="beams",
            kind="lines",
            source="the task",
            rate_hz=1 / self.task.control_s,
            elevations_deg=(0.0,),
            range_m=(near_m, far_m),
            range_at_ten_percent_m=_TEN_PERCENT_SHARE * far_m,
            noise_m=0.0,  # the task has its own
            about={},
        )
        self._beam_rngs: list[np.random.Generator] = [np.random.default_rng(0) for _ in range(self.count)]
        self._usable_m = np.zeros((0, self.task.beams))

    def reset(
        self, robots: np.ndarray, rngs: list[np.random.Generator], start: EpisodeStart | None = None
    ) -> StepOutcome:
        """Place robots, whose beams draw from children of their generators."""
        for robot in robots.tolist():
            self._beam_rngs[robot] = source_of(rngs[robot], robot, start).spawn(1)[0]
        return super().reset(robots, rngs, start)

    def true_ranges(self, robots: np.ndarray) -> np.ndarray:
        """Return the ranges (k, beams) m to rock and floor, as if the air were clear."""
        return super()._cast(robots)[2]

    def _cast(self, robots: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        origin, directions, true = super()._cast(robots)
        rows = [
            self._measured(start, ways, robot)
            for start, ways, robot in zip(origin, directions, robots.tolist(), strict=True)
        ]
        measured = np.array(rows).reshape(true.shape)
        lost = ~np.isfinite(measured)
        self._usable_m = np.where(lost, 0.0, np.minimum(measured, true))
        return origin, directions, np.where(lost, self.task.range_m[1], measured)

    def _measured(self, origin: np.ndarray, directions: np.ndarray, robot: int) -> np.ndarray:
        """Return the ranges (beams,) m of one robot's beams, inf for no return."""
        ways, surfaces = directions.astype(np.float32), self.surfaces_round(robot, self._surfaces)
        hits: Hits = degrade_hits(
            *(surfaces.cast(origin, ways), origin, ways, self._pattern, self._conditions, surfaces),
            self._beam_rngs[robot],
        )
        return hits.range_m.astype(np.float64)

    def _crossed(self, origin: np.ndarray, directions: np.ndarray, ranges: np.ndarray) -> tuple[np.ndarray, ...]:
        return super()._crossed(origin, directions, self._usable_m)

    def copy_state(self) -> dict[str, Any]:
        """Return a copy of all that changes, the beams' random numbers too."""
        return {**super().copy_state(), "beam_rngs": list(self._beam_rngs)}

    def restore_state(self, state: dict[str, Any]) -> None:
        """Take what `copy_state` returned."""
        super().restore_state(state)
        self._beam_rngs = list(state["beam_rngs"])


class DegradedOdometryBatch(DegradedBatch, OdometryBatch):
    """Robots with degraded beams that know their pose by their wheels only."""


class DegradedFlyerBatch(DegradedBatch, FlyerBatch):
    """Robots that fly with degraded beams."""


def kind_of_batch(robot: Robot, pose: object, conditions: SensorParams) -> type[RobotBatch]:
    """Return the kind of batch of robots that fly or drive, by a true or a counted pose, with clear or degraded beams.

    Raises
    ------
    ValueError
        If a robot without wheels is to count them.
    """
    if robot.FLIES and pose != "true":
        raise ValueError(f"pose = {pose!r}: a quadrotor has no wheels; want true")
    clear, degraded = (FlyerBatch, DegradedFlyerBatch) if robot.FLIES else (RobotBatch, DegradedBatch)
    if pose == "odometry":
        clear, degraded = OdometryBatch, DegradedOdometryBatch
    return clear if conditions.is_ideal else degraded
