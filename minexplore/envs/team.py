"""A team of robots in one physics model with one map of what was seen."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from minexplore.envs.robot_batch import RobotBatch
from minexplore.physics.robot import RobotParams, qpos_address, qvel_address
from minexplore.sensing.coverage import mark
from minexplore.sensing.lidar import Backend
from minexplore.task import TaskParams
from minexplore.tasks.exploration import StepOutcome
from minexplore.world import World

_APART_M = 1.2  # least distance between two robots at the start, centre to centre
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class Team(RobotBatch):
    """Robots that see and touch each other."""

    def __init__(self, world: World, task: TaskParams, robot: RobotParams, count: int, lidar: Backend = "auto") -> None:
        """Compile the mine with all robots."""
        super().__init__(world, task, robot, count, lidar=lidar)
        names = tuple(f"robot_{i}" for i in range(count))
        self.model = world.compile(self.local_models.spec(None, names))
        self.data = mujoco.MjData(self.model)
        self._qpos_at = np.array([qpos_address(self.model, name) for name in names])
        self._qvel_at = np.array([qvel_address(self.model, name) for name in names])
        self._names, self._taken = names, list[list[float]]()
        self.team_seen = np.zeros((1, *self.grid.reachable.shape), dtype=bool)

    def reset_all(self, rngs: list[np.random.Generator]) -> StepOutcome:
        """Place the whole team near the entrance."""
        self._taken = []
        self.team_seen[:] = False
        mujoco.mj_resetData(self.model, self.data)
        outcome = self.reset(np.arange(self.count), rngs)
        mujoco.mj_forward(self.model, self.data)
        return outcome

    def copy_state(self) -> dict[str, Any]:
        """Return a copy of all that changes while the team drives; see `RobotBatch.copy_state`."""
        physics = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, physics, _STATE)
        return {**super().copy_state(), "team_seen": self.team_seen.copy(), "physics": physics}

    def restore_state(self, state: dict[str, Any]) -> None:
        """Take what `copy_state` returned; see `RobotBatch.restore_state`."""
        super().restore_state(state)
        self.team_seen[...] = state["team_seen"]
        mujoco.mj_setState(self.model, self.data, state["physics"], _STATE)

    def place(self, robot: int, x_m: float, y_m: float, yaw_rad: float, z_m: float | None = None) -> None:
        """Place a robot, at rest, at a pose; see `RobotBatch.place`."""
        super().place(robot, x_m, y_m, yaw_rad, z_m)
        self.data.qpos[self._qpos_at[robot]] = self.qpos[robot, : self._qpos_at.shape[1]]
        self.data.qvel[self._qvel_at[robot]] = 0.0

    def _sample_place(self, rng: np.random.Generator) -> list[float]:
        """Return a random place (m, mine frame) of the entrance region apart from the robots placed before."""
        if not self._taken:
            self._taken.append(super()._sample_place(rng))
            return self._taken[0]
        places = self.ground.entrance_places(self.robot.radius_m + 0.1)
        apart = np.min([np.linalg.norm(places - taken, axis=1) for taken in self._taken], axis=0) >= _APART_M
        free = places[apart]
        if not len(free):
            raise ValueError(
                f"{self.world.folder}: no room near the entrance for robot {len(self._taken)} of {self.count}"
            )
        self._taken.append(free[rng.integers(len(free))].tolist())
        return self._taken[-1]

    def _advance(self, robots: np.ndarray, places_m: np.ndarray) -> np.ndarray:
        touched = np.zeros(self.count, dtype=bool)
        self.ground.prepare_team(self.model, self._names, places_m, self.qpos[robots, 3:7])
        self.data.ctrl[:] = self.stepper.ctrl.ravel()
        for _ in range(self.task.substeps):
            mujoco.mj_step(self.model, self.data)
            touched |= self.data.sensordata > 0
        for own, of_model, at in (
            (self.qpos, self.data.qpos, self._qpos_at),
            (self.qvel, self.data.qvel, self._qvel_at),
        ):
            own[:, : at.shape[1]] = of_model[at]  # behind them are sprung castors, which nothing else looks at
        return touched[robots]

    def _look(self, robots: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cast the beams and mark the team's map; a cell that two see at once counts for the first."""
        origin, directions, ranges = self._cast(robots)
        ray, *cell = self._crossed(origin, directions, ranges)
        new = np.zeros(len(robots), dtype=int)
        for i in range(len(robots)):
            own = ray // self.task.beams == i
            observer = np.zeros(int(own.sum()), dtype=int)
            new[i] = mark(self.grid, self.team_seen, observer, *(index[own] for index in cell))[0]
        return ranges, new

    def _cast(self, robots: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Cast beams that rock and the other robots' scanners stop."""
        origin, directions, ranges = super()._cast(robots)
        return origin, directions, np.minimum(ranges, self._to_others(origin, directions))

    def _to_others(self, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return distances (n, beams) m to the upright cylinders of the other robots' scanners."""
        apart = origin[None, :, :2] - origin[:, None, :2]  # (from, to, 2)
        along = np.einsum("ibk,ijk->ijb", directions[..., :2], apart)
        across = (apart**2).sum(axis=-1)[..., None] - along**2
        half = self.robot.scanner_radius_m**2 - across
        distance = np.where((half > 0) & (along > 0), along - np.sqrt(np.maximum(half, 0.0)), np.inf)
        distance[np.arange(len(origin)), np.arange(len(origin))] = np.inf
        level = origin[:, None, None, 2] + np.where(np.isfinite(distance), distance, 0.0) * directions[:, None, :, 2]
        high = np.abs(level - origin[None, :, None, 2]) <= self.robot.scanner_height_m / 2
        return np.where(high, distance, np.inf).min(axis=1)
