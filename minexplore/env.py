"""The exploration environment: one robot, sixteen beams, a mine it does not know."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np

from minexplore.coverage import CoverageGrid
from minexplore.reward import Reward
from minexplore.robot import ROBOT_GROUP, RobotParams, attach_robot, separate_contacts, stand
from minexplore.world import load_world

_FLOOR_GROUP, _SURFACE_GROUP, _ROCK_GROUP = 0, 2, 3
# What a zone does to a command beside its contact friction: scale, and noise on the forward speed, m/s.
TERRAIN = {"dry": (1.0, 0.0), "mud": (0.7, 0.04), "water": (0.4, 0.10)}


@dataclass(frozen=True)
class TaskParams:
    """What the paper fixes, and what it leaves open (the second block), with its default."""

    beams: int = 16
    range_m: tuple[float, float] = (0.12, 10.0)
    range_noise_m: float = 0.01
    max_forward_mps: float = 1.5
    max_turn_radps: float = 1.5
    max_steps: int = 6000
    stall_steps: int = 100
    stall_speed_mps: float = 0.01
    control_s: float = 0.1
    cell_m: float = 2.0

    physics_s: float = 0.005
    region_m: float = np.inf
    terrain: bool = True
    tilt: bool = True


class MineEnv(gymnasium.Env):
    """Explore a mine: see as many of the reachable 2 m cells as possible.

    Parameters
    ----------
    world : str or Path
        A world bundle; it is refused if its hashes do not hold.
    task : TaskParams, optional
    robot : RobotParams, optional
    render_mode : {None, "rgb_array"}
        A camera behind and above the robot; needs an OpenGL (headless: `MUJOCO_GL=osmesa`).

    Observations are 19 numbers: 16 ranges in [0, 1], the previous forward command, 0, the previous turn command.
    Actions are forward speed and turn rate in [-1, 1], of 1.5 m/s and 1.5 rad/s. `terminated` is always False.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        world: str | Path,
        task: TaskParams | None = None,
        robot: RobotParams | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Load the world and put the robot into it."""
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode = {render_mode!r}: valid choices are None, 'rgb_array'")
        self.task, self.robot, self.render_mode = task or TaskParams(), robot or RobotParams(), render_mode
        self.world = load_world(world)
        self._T = self.world.T_world_mine.copy()
        if not self.task.tilt:
            self._T[:3, :3] = np.eye(3)
        self._Tinv = np.linalg.inv(self._T)
        self.model = self._compile()
        self.data = mujoco.MjData(self.model)
        self._body = self.model.body("robot").id
        self._site = self.model.site("robot_lidar").id
        self._chassis = self.model.geom("robot_chassis").id
        self._is_rock = self.model.geom_group >= _ROCK_GROUP
        self._substeps = round(self.task.control_s / self.task.physics_s)
        spawn = self.world.record["spawn"]
        self.grid = CoverageGrid(
            self.world, self.task.cell_m, self.robot.radius_m, np.array(spawn["anchor_m"]), self.task.region_m
        )
        angles = 2 * np.pi * np.arange(self.task.beams) / self.task.beams
        self._beams = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(self.task.beams)])
        self._groups = np.zeros(mujoco.mjNGROUP, dtype=np.uint8)
        self._groups[[_FLOOR_GROUP, ROBOT_GROUP, _SURFACE_GROUP]] = 1
        size = self.task.beams + 3
        low = np.array([0.0] * self.task.beams + [-1.0] * 3, dtype=np.float32)
        self.observation_space = gymnasium.spaces.Box(low, np.ones(size, dtype=np.float32), dtype=np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
        self._renderer: mujoco.Renderer | None = None

    def _compile(self) -> mujoco.MjModel:
        spec = self.world.spec()
        spec.option.timestep = self.task.physics_s
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        separate_contacts(spec)
        attach_robot(spec, "robot", self.robot)
        mine = spec.body("mine")
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, self._T[:3, :3].ravel())
        mine.quat, mine.pos = quat, self._T[:3, 3]
        if not self.task.terrain:
            for ground in self.world.grounds:
                spec.geom(ground.geom).friction = [1.0, 0.005, 0.0001]
        return spec.compile()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Stand the robot at the anchor near the entrance with a random yaw, and look round once."""
        super().reset(seed=seed)
        mujoco.mj_resetData(self.model, self.data)
        x, y = self._spawn_place()
        self.data.qpos[:7] = stand(self._T, self.robot, x, y, self.np_random.uniform(-np.pi, np.pi))
        mujoco.mj_forward(self.model, self.data)
        self._seen = np.zeros_like(self.grid.reachable)
        self._previous = np.zeros(2)
        self._steps = self._stalled = self._collisions = 0
        ranges, new = self._look()
        # What the first look sees is seen, but no step earned it.
        self._reward = Reward(self.grid.total, seen_cells=new)
        return self._observe(ranges), self._info(collision=False)

    def _spawn_place(self) -> tuple[float, float]:
        spawn, world = self.world.record["spawn"], self.world
        if spawn["anchor_clearance_m"] >= spawn["clearance_m"] >= self.robot.radius_m:
            return spawn["anchor_m"][0], spawn["anchor_m"][1]
        row, col = np.nonzero(world.clearance_m >= self.robot.radius_m)
        places = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
        near = places[np.linalg.norm(places - spawn["centre_m"], axis=1) <= spawn["radius_m"]]
        if not len(near):
            raise ValueError(f"{world.folder}: the robot ({self.robot.radius_m} m) fits nowhere near the entrance")
        x, y = near[self.np_random.integers(len(near))]
        return float(x), float(y)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Drive for one control step and look round."""
        command = np.asarray(action, dtype=np.float64)
        if command.shape != (2,) or not np.isfinite(command).all():
            raise ValueError(f"action = {action!r}: want two finite numbers in [-1, 1]")
        command = np.clip(command, -1.0, 1.0)
        scale, noise = self._terrain()
        forward = command[0] * self.task.max_forward_mps * scale
        if noise:
            forward += self.np_random.normal(0.0, noise)
        self.data.ctrl[:] = self.robot.wheel_speeds(forward, command[1] * self.task.max_turn_radps * scale)
        collision = self._drive()
        self._collisions += collision
        self._previous = command
        ranges, new = self._look()
        reward = self._reward.step(new, collision)
        self._steps += 1
        self._stalled = self._stalled + 1 if self._speed() < self.task.stall_speed_mps else 0
        truncated = self._steps >= self.task.max_steps or self._stalled >= self.task.stall_steps
        return self._observe(ranges), reward, False, truncated, self._info(collision)

    def _terrain(self) -> tuple[float, float]:
        if not self.task.terrain:
            return 1.0, 0.0
        return TERRAIN.get(self._ground(), (1.0, 0.0))

    def _ground(self) -> str:
        return self.world.grounds[self.world.ground_at(self._pose()[0])].name

    def _drive(self) -> bool:
        """Step the physics for one control step; say whether the chassis touched rock."""
        touched = False
        for _ in range(self._substeps):
            mujoco.mj_step(self.model, self.data)
            pairs = self.data.contact.geom
            ours = (pairs == self._chassis).any(axis=1)
            touched = touched or bool(self._is_rock[pairs[ours]].any())
        return touched

    def _speed(self) -> float:
        along = self._Tinv[:3, :3] @ self.data.qvel[:3]
        return float(np.hypot(along[0], along[1]))

    def _pose(self) -> np.ndarray:
        """Return x, y (m) and yaw (rad) in the mine frame."""
        place = self._Tinv @ [*self.data.xpos[self._body], 1.0]
        heading = self._Tinv[:3, :3] @ self.data.xmat[self._body].reshape(3, 3)[:, 0]
        return np.array([place[0], place[1], np.arctan2(heading[1], heading[0])])

    def _look(self) -> tuple[np.ndarray, int]:
        """Cast the beams in the robot's own plane; return true ranges, m, and how many cells are seen anew."""
        n, far = self.task.beams, self.task.range_m[1]
        directions = self._beams @ self.data.xmat[self._body].reshape(3, 3).T
        start, hit, distance = self.data.site_xpos[self._site], np.zeros(n, np.int32), np.zeros(n)
        mujoco.mj_multiRay(
            self.model,
            self.data,
            start,
            directions.ravel(),
            self._groups,
            True,
            self._body,
            hit,
            distance,
            None,
            n,
            far,
        )
        ranges = np.where(distance < 0, far, np.minimum(distance, far))
        ends = (start + directions * ranges[:, None]) @ self._Tinv[:3, :3].T + self._Tinv[:3, 3]
        origin = self._Tinv[:3, :3] @ start + self._Tinv[:3, 3]
        row, col = self.grid.cells_crossed(origin[:2], ends[:, :2])
        before = self._seen.sum()
        self._seen[row, col] |= self.grid.reachable[row, col]
        return ranges, int(self._seen.sum() - before)

    def _observe(self, ranges: np.ndarray) -> np.ndarray:
        near, far = self.task.range_m
        noisy = np.clip(ranges, near, far) + self.np_random.normal(0.0, self.task.range_noise_m, len(ranges))
        scaled = np.clip((noisy - near) / (far - near), 0.0, 1.0)
        return np.concatenate([scaled, [self._previous[0], 0.0, self._previous[1]]]).astype(np.float32)

    def _info(self, collision: bool) -> dict[str, Any]:
        seen = int(self._seen.sum())
        return {
            "cells_seen": seen,
            "cells_reachable": self.grid.total,
            "coverage": seen / self.grid.total,
            "collision": collision,
            "collisions": self._collisions,
            "zone": self._ground(),
            "pose_m_rad": self._pose(),
        }

    def render(self) -> np.ndarray | None:
        """Return a picture from behind and above the robot, (480, 640, 3) uint8, or None without a render mode."""
        if self.render_mode is None:
            return None
        if self._renderer is None:
            self._renderer = mujoco.Renderer(self.model, 480, 640)
        camera = mujoco.MjvCamera()
        camera.type = mujoco.mjtCamera.mjCAMERA_FREE
        camera.lookat[:] = self.data.xpos[self._body]
        heading = self.data.xmat[self._body].reshape(3, 3)[:, 0]
        camera.azimuth = float(np.degrees(np.arctan2(heading[1], heading[0])))
        camera.distance, camera.elevation = 2.5, -25.0
        self._renderer.update_scene(self.data, camera)
        return self._renderer.render().copy()

    def close(self) -> None:
        """Free the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
