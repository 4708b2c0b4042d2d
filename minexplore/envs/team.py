"""A team: robots of any batch in one physics model, with one map of what was seen."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.lib.stride_tricks import as_strided

from minexplore.envs.robot_batch import RobotBatch
from minexplore.envs.sensed.others import BeamsAmong, OtherRobots, SurfacesAmong
from minexplore.physics.team_stepper import TeamStepper
from minexplore.sensing.coverage import mark
from minexplore.tasks.exploration import StepOutcome
from minexplore.tasks.starts import EpisodeStart

_BETWEEN_M = 0.5  # two robots at the start, at least
_ROOM_M = 0.1  # to rock, beside a robot at the start


class Team(RobotBatch):
    """Robots that see and touch each other; in all else each is the robot of a batch.

    `seen` has a row for each robot, as in any batch, but all rows are one map.
    """

    stepper: TeamStepper  # type: ignore[assignment]

    def __init__(self, *arguments: Any, **named: Any) -> None:
        """Take the arguments of a batch, and compile the mine with all robots."""
        super().__init__(*arguments, **named)
        self.model, self.data = self.stepper.model, self.stepper.data
        self._others = [OtherRobots(self.stepper, robot, self.T_world_mine) for robot in range(self.count)]
        self.lidar = BeamsAmong(self.lidar, self.robot, self._others)  # type: ignore[assignment]
        self._taken: list[np.ndarray] = []
        self.team_seen = np.zeros((1, *self.grid.reachable.shape), dtype=bool)
        self.seen = as_strided(self.team_seen, self.seen.shape, (0, *self.team_seen.strides[1:]))

    def _make_stepper(self, threads: int) -> TeamStepper:  # type: ignore[override]
        return TeamStepper(self.world, self.local_models, self.robot, self.count)

    def surfaces_round(self, robot: int, surfaces: Any) -> SurfacesAmong:
        """Return what casts a robot's rays at rock and at the other robots."""
        return SurfacesAmong(surfaces, self._others[robot])

    def reset_all(self, rngs: list[np.random.Generator], start: EpisodeStart | None = None) -> StepOutcome:
        """Place the whole team near the entrance, or as `start` says; see `RobotBatch.reset`."""
        self._taken = []
        mujoco.mj_resetData(self.model, self.data)
        outcome = self.reset(self._every, rngs, start)
        mujoco.mj_forward(self.model, self.data)
        return outcome

    def copy_state(self) -> dict[str, Any]:
        """Return a copy of all that changes while the team drives; see `RobotBatch.copy_state`."""
        return {**super().copy_state(), "physics": self.stepper.copy_state()}

    def restore_state(self, state: dict[str, Any]) -> None:
        """Take what `copy_state` returned; see `RobotBatch.restore_state`."""
        super().restore_state(state)
        self.stepper.restore_state(state["physics"])

    def _start_pose(self, robot: int, rng: np.random.Generator, start: EpisodeStart | None) -> list[float]:
        """Return where a robot begins: as alone, or at the nearest free place apart from those placed before."""
        x, y, yaw, *z = super()._start_pose(robot, rng, start)
        place = np.array([x, y, *z])
        if not self._are_apart(place[None])[0]:
            places = self._apart(self.ground.places(self.robot.radius_m + _ROOM_M))
            away = np.linalg.norm(places[:, : len(place)] - place, axis=1)
            place = places[int(away.argmin())]
        self._taken.append(place)
        return [*place[:2].tolist(), yaw, *place[2:].tolist()]

    def _sample_place(self, rng: np.random.Generator) -> list[float]:
        """Return a random place (m, mine frame) of the entrance region apart from the robots placed before."""
        if not self._taken:
            return super()._sample_place(rng)
        free = self._apart(self._entrance_places(self.robot.radius_m + _ROOM_M))
        found: list[float] = free[rng.integers(len(free))].tolist()
        return found

    def _apart(self, places: np.ndarray) -> np.ndarray:
        """Return those of places (n, 2 or 3) m that are apart from the robots placed before."""
        free = places[self._are_apart(places)]
        if not len(free):
            placed = f"robot {len(self._taken)} of {self.count}"
            raise ValueError(f"{self.world.folder}: no room near the entrance for {placed}")
        return free

    def _are_apart(self, places: np.ndarray) -> np.ndarray:
        """Return which of places (n, 2 or 3) m are apart from the robots placed before, (n,) bool."""
        found, least_m = np.ones(len(places), dtype=bool), 2 * self.robot.radius_m + _BETWEEN_M
        for taken in self._taken:
            known = min(len(taken), places.shape[1])
            found &= np.linalg.norm(places[:, :known] - taken[:known], axis=1) >= least_m
        return found

    def _advance(self, robots: np.ndarray, places_m: np.ndarray) -> np.ndarray:
        self.ground.prepare_team(self.model, self.stepper.names, places_m, self.qpos[:, 3:7])
        return self.stepper.advance(robots, places_m, self.task.substeps)

    def _look(self, robots: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cast the beams and mark the team's map; a cell that two see at once counts for the first."""
        origin, directions, ranges = self._cast(robots)
        ray, *cell = self._crossed(origin, directions, ranges)
        new = np.zeros(len(robots), dtype=int)
        for i in range(len(robots)):
            own = ray // len(self._beams) == i
            observer = np.zeros(int(own.sum()), dtype=int)
            new[i] = mark(self.grid, self.team_seen, observer, *(index[own] for index in cell))[0]
        return ranges, new


def team_of(kind: type[RobotBatch]) -> type[Team]:
    """Return the kind of a team whose robots are in all else those of a kind of batch."""
    return Team if kind is RobotBatch else type(f"Team{kind.__name__}", (Team, kind), {})
