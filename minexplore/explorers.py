"""Many robots, each alone in its own copy of one mine: physics in windows, beams, coverage, reward, episodes."""

from __future__ import annotations

import functools
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch

from minexplore.coverage import CoverageGrid
from minexplore.lidar import Backend, Lidar, surface_meshes
from minexplore.reward import step_reward
from minexplore.robot import RobotParams, stand
from minexplore.task import TERRAIN, TaskParams
from minexplore.windows import Windows
from minexplore.world import World, load_world

_CHUNK = 16  # robots of one window that a thread steps in one call
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


@functools.lru_cache(maxsize=8)
def shared_lidar(folder: Path, world_sha256: str, range_m: float, backend: Backend) -> Lidar:
    """Return the beams of a world, made once a process."""
    world = load_world(folder)
    return Lidar(surface_meshes(world.spec(), folder), range_m, backend)


@dataclass
class Outcome:
    """What a step of robots gave: observations (n, beams + 3) float32, rewards (n,), truncations (n,), and the info."""

    observation: np.ndarray
    reward: np.ndarray
    truncated: np.ndarray
    info: dict[str, np.ndarray]


class Explorers:
    """The state of n robots and what may be done with it: `reset` some, `step` all.

    Robots are stepped by the model of the window they stand in; a robot that drives into another takes its row of
    state along. A row holds the whole integration state, so it does not matter in which batch it is advanced.
    """

    def __init__(
        self,
        world: World,
        task: TaskParams,
        robot: RobotParams,
        count: int,
        threads: int = 1,
        lidar: Backend = "auto",
        whole: bool = False,
    ) -> None:
        """Take a world; `whole` steps every robot in the model of all rock, for comparison."""
        self.world, self.task, self.robot, self.count = world, task, robot, count
        self.windows = Windows(world, task, robot, whole)
        self.T_world_mine = self.windows.T_world_mine
        self._R, self._t = self.T_world_mine[:3, :3], self.T_world_mine[:3, 3]
        self.lidar = shared_lidar(world.folder, world.record["world_sha256"], task.range_m[1], lidar)
        spawn = world.record["spawn"]
        self.grid = CoverageGrid(world, task.cell_m, robot.radius_m, np.array(spawn["anchor_m"]), task.region_m)
        angles = 2 * np.pi * np.arange(task.beams) / task.beams
        self._beams = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(task.beams)])
        self._scale, self._noise = (
            np.array([TERRAIN.get(g.name, (1.0, 0.0))[k] if task.terrain else (1.0, 0.0)[k] for g in world.grounds])
            for k in (0, 1)
        )
        self._batches: dict[tuple[int, int, int], Batch] = {}
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        model = self.windows.model(tuple(self.windows.tiles_of(np.array([spawn["anchor_m"]]))[0]))
        data = mujoco.MjData(model)
        first = np.zeros(mujoco.mj_stateSize(model, _STATE))
        mujoco.mj_getState(model, data, first, _STATE)
        self._first, nq, nv = first, model.nq, model.nv
        self.state = np.tile(first, (count, 1))
        self.qpos, self.qvel = self.state[:, 1 : 1 + nq], self.state[:, 1 + nq : 1 + nq + nv]
        self.ctrl_at = _place_of_control(model, data)
        self.seen = np.zeros((count, *self.grid.reachable.shape), dtype=bool)
        self.cells_seen = np.zeros(count, dtype=int)
        self.previous = np.zeros((count, 2))
        self.steps, self.stalled, self.collisions = (np.zeros(count, dtype=int) for _ in range(3))

    def reset(self, robots: np.ndarray, rngs: list[np.random.Generator]) -> Outcome:
        """Stand robots (k,) at the anchor near the entrance with a random yaw, and look round once."""
        for i in robots.tolist():
            x, y = self._spawn_place(rngs[i])
            self.place(i, x, y, rngs[i].uniform(-np.pi, np.pi))
        self.seen[robots] = False
        self.previous[robots] = 0.0
        for counter in (self.steps, self.stalled, self.collisions, self.cells_seen):
            counter[robots] = 0
        ranges, new = self._look(robots)
        self.cells_seen[robots] = new  # what the first look sees is seen, but no step earned it
        nothing = np.zeros(len(robots))
        return Outcome(self._observe(robots, ranges, rngs), nothing, nothing > 0, self._info(robots, nothing > 0))

    def place(self, robot: int, x_m: float, y_m: float, yaw_rad: float) -> None:
        """Stand a robot, at rest, at a pose of the mine frame."""
        self.state[robot] = self._first
        self.qpos[robot, :7] = stand(self.T_world_mine, self.robot, x_m, y_m, yaw_rad)

    def _spawn_place(self, rng: np.random.Generator) -> tuple[float, float]:
        spawn, world = self.world.record["spawn"], self.world
        if spawn["anchor_clearance_m"] >= spawn["clearance_m"] >= self.robot.radius_m:
            return spawn["anchor_m"][0], spawn["anchor_m"][1]
        row, col = np.nonzero(world.clearance_m >= self.robot.radius_m)
        places = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
        near = places[np.linalg.norm(places - spawn["centre_m"], axis=1) <= spawn["radius_m"]]
        if not len(near):
            raise ValueError(f"{world.folder}: the robot ({self.robot.radius_m} m) fits nowhere near the entrance")
        x, y = near[rng.integers(len(near))]
        return float(x), float(y)

    def step(self, actions: np.ndarray, rngs: list[np.random.Generator], robots: np.ndarray | None = None) -> Outcome:
        """Drive robots for one control step and look round.

        Parameters
        ----------
        actions : (n, 2)
            Forward speed and turn rate in [-1, 1]; clipped.
        rngs : list of Generator
            One a robot.
        robots : (k,) int, optional
            Which robots drive; all by default. The outcome has k rows.

        Raises
        ------
        ValueError
            If an action is not finite or the shape is wrong; it names the robot.
        """
        robots = np.arange(self.count) if robots is None else robots
        command = self._commands(actions, robots)
        collision = self.drive(command, rngs, robots)
        self.collisions[robots] += collision
        self.previous[robots] = command
        ranges, new = self._look(robots)
        reward = step_reward(self.cells_seen[robots], new, self.grid.total, collision)
        self.cells_seen[robots] += new
        self.steps[robots] += 1
        still = self._speeds(robots) < self.task.stall_speed_mps
        self.stalled[robots] = np.where(still, self.stalled[robots] + 1, 0)
        truncated = (self.steps[robots] >= self.task.max_steps) | (self.stalled[robots] >= self.task.stall_steps)
        return Outcome(self._observe(robots, ranges, rngs), reward, truncated, self._info(robots, collision))

    def _commands(self, actions: np.ndarray, robots: np.ndarray) -> np.ndarray:
        """Return the clipped actions (k, 2) of robots out of all robots' actions (n, 2)."""
        command = np.asarray(actions, dtype=np.float64)
        if command.shape != (self.count, 2):
            raise ValueError(f"actions of shape {command.shape}: want ({self.count}, 2)")
        bad = ~np.isfinite(command).all(axis=1)
        if bad.any():
            i = int(bad.argmax())
            raise ValueError(f"action of robot {i} = {command[i].tolist()}: want two finite numbers in [-1, 1]")
        return np.clip(command[robots], -1.0, 1.0)

    def drive(self, command: np.ndarray, rngs: list[np.random.Generator], robots: np.ndarray) -> np.ndarray:
        """Advance robots (k,) by one control step without looking round.

        Parameters
        ----------
        command : (k, 2)
            Forward speed and turn rate in [-1, 1].
        rngs : list of Generator
            One for each of all robots.
        robots : (k,) int

        Returns
        -------
        (k,) bool
            Whether the chassis touched rock in any physics step.
        """
        task = self.task
        zone = self.world.zones_at(self.poses()[robots, 0])
        forward = command[:, 0] * task.max_forward_mps * self._scale[zone]
        for k in np.flatnonzero(self._noise[zone]).tolist():
            forward[k] += rngs[robots[k]].normal(0.0, self._noise[zone[k]])
        left, right = self.robot.wheel_speeds(forward, command[:, 1] * task.max_turn_radps * self._scale[zone])
        self.state[robots, self.ctrl_at], self.state[robots, self.ctrl_at + 1] = left, right
        return self._roll(robots)

    def _roll(self, robots: np.ndarray) -> np.ndarray:
        """Step the physics of robots (k,), each in its window, for one control step; return which touched rock."""
        tiles = self.windows.tiles_of(self.poses()[robots, :2])
        touched = np.zeros(self.count, dtype=bool)
        jobs: list[list[tuple[tuple[int, int], np.ndarray]]] = [[] for _ in range(self._threads)]
        order = np.lexsort((tiles[:, 1], tiles[:, 0]))
        first = np.flatnonzero(np.any(np.diff(tiles[order], axis=0, prepend=tiles[order][:1] - 1) != 0, axis=1))
        pieces = [
            (tuple(tiles[group[0]].tolist()), robots[group[at : at + _CHUNK]])
            for group in np.split(order, first[1:])
            for at in range(0, len(group), _CHUNK)
        ]
        for k, piece in enumerate(sorted(pieces, key=lambda p: -len(p[1]))):
            jobs[k % self._threads].append(piece)
        if self._pool is None:
            self._advance(0, jobs[0], touched)
        else:
            list(self._pool.map(self._advance, range(self._threads), jobs, [touched] * self._threads))
        return touched[robots]

    def _advance(self, thread: int, job: list[tuple[tuple[int, int], np.ndarray]], touched: np.ndarray) -> None:
        for tile, rows in job:
            batch = self._batches.get((thread, *tile))
            if batch is None:
                batch = Batch(self.windows.model(tile), _CHUNK, 1, False)
                self._batches[(thread, *tile)] = batch
            ids = np.arange(len(rows))
            batch.state[: len(rows)] = self.state[rows]
            record = batch.rollout(self.task.substeps, record=("sensordata",), ids=ids)["sensordata"]
            self.state[rows] = batch.state[: len(rows)]
            touched[rows] = (record[..., 0] > 0).any(axis=1)
            if batch.warning[: len(rows)].any():
                bad = rows[np.flatnonzero(batch.warning[: len(rows)].reshape(len(rows), -1).any(axis=1))[0]]
                raise RuntimeError(f"robot {bad}: MuJoCo warns of its physics at state {self.qpos[bad].tolist()}")

    def poses(self) -> np.ndarray:
        """Return every robot's x, y (m) and yaw (rad) in the mine frame, (n, 3)."""
        place = _turned(self.qpos[:, :3] - self._t, self._R)
        heading = _turned(_rotations(self.qpos[:, 3:7])[:, :, 0], self._R)
        return np.column_stack([place[:, :2], np.arctan2(heading[:, 1], heading[:, 0])])

    def _speeds(self, robots: np.ndarray) -> np.ndarray:
        along = _turned(self.qvel[robots, :3], self._R)
        return np.hypot(along[:, 0], along[:, 1])

    def _look(self, robots: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cast the beams in each robot's own plane; return true ranges (k, beams) m, and cells seen anew (k,)."""
        origin, directions = self._rays(robots)
        ranges = self.lidar.cast(origin, directions)
        ray, row, col = self._crossed(origin, directions, ranges)
        seen = self.seen if len(robots) == self.count else self.seen[robots]
        new = self.grid.mark(seen, ray // self.task.beams, row, col)
        if seen is not self.seen:
            self.seen[robots] = seen
        return ranges, new

    def _rays(self, robots: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the beams' origins (k, 3) m and directions (k, beams, 3) in the mine frame."""
        axes = [_turned(axis, self._R) for axis in np.moveaxis(_rotations(self.qpos[robots, 3:7]), 2, 0)]
        lift = self.robot.sensor_height_m - self.robot.wheel_radius_m
        origin = _turned(self.qpos[robots, :3] - self._t, self._R) + lift * axes[2]
        ahead, left = (axis[:, None, :] for axis in axes[:2])
        return origin, self._beams[:, :1] * ahead + self._beams[:, 1:2] * left

    def _crossed(
        self, origin: np.ndarray, directions: np.ndarray, ranges: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return ray numbers, rows and columns of the cells that the beams pass through."""
        ends = origin[:, None, :2] + directions[..., :2] * ranges[..., None]
        starts = np.repeat(origin[:, :2], self.task.beams, axis=0)
        return self.grid.cells_crossed(starts, ends.reshape(-1, 2), self.task.range_m[1])

    def _observe(self, robots: np.ndarray, ranges: np.ndarray, rngs: list[np.random.Generator]) -> np.ndarray:
        near, far = self.task.range_m
        noise = np.stack([rngs[i].standard_normal(self.task.beams) for i in robots.tolist()])
        noisy = np.clip(ranges, near, far) + self.task.range_noise_m * noise
        scaled = np.clip((noisy - near) / (far - near), 0.0, 1.0)
        command = self.previous[robots]
        zero = np.zeros((len(robots), 1))
        return np.hstack([scaled, command[:, :1], zero, command[:, 1:]]).astype(np.float32)

    def _info(self, robots: np.ndarray, collision: np.ndarray) -> dict[str, np.ndarray]:
        poses = self.poses()[robots]
        return {
            "cells_seen": self.cells_seen[robots],
            "cells_reachable": np.full(len(robots), self.grid.total),
            "coverage": self.cells_seen[robots] / self.grid.total,
            "collision": np.asarray(collision),
            "collisions": self.collisions[robots].copy(),
            "zone": self.world.zone_names[self.world.zones_at(poses[:, 0])],
            "pose_m_rad": poses,
        }

    def close(self) -> None:
        """Stop the threads."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None


def observation_bounds(task: TaskParams) -> tuple[np.ndarray, np.ndarray]:
    """Return the observation's lower and upper bounds, (beams + 3,) float32."""
    low = np.array([0.0] * task.beams + [-1.0] * 3, dtype=np.float32)
    return low, np.ones(task.beams + 3, dtype=np.float32)


def _turned(vectors: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return `vectors @ rotation`, (n, 3), rounded alike for any number of vectors, which BLAS does not promise."""
    return vectors[:, :1] * rotation[0] + vectors[:, 1:2] * rotation[1] + vectors[:, 2:] * rotation[2]


def _rotations(quat: np.ndarray) -> np.ndarray:
    """Return rotation matrices (n, 3, 3) of unit quaternions (n, 4), w first."""
    w, x, y, z = quat.T
    return np.stack(
        [
            np.stack([w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=-1),
            np.stack([2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)], axis=-1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z], axis=-1),
        ],
        axis=1,
    )


def _place_of_control(model: mujoco.MjModel, data: mujoco.MjData) -> int:
    """Return where the controls begin in the integration state."""
    state = np.zeros(mujoco.mj_stateSize(model, _STATE))
    data.ctrl[:] = np.pi
    mujoco.mj_getState(model, data, state, _STATE)
    data.ctrl[:] = 0.0
    return int(np.flatnonzero(state == np.pi)[0])


def as_dict(info: dict[str, np.ndarray], row: int) -> dict[str, Any]:
    """Return one robot's info as plain values."""
    return {k: v[row].item() if v[row].ndim == 0 else v[row].copy() for k, v in info.items()}
