"""The reference for speed: one environment as it is usually written, on the whole world, with nothing shared."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from minexplore.bundle import SURFACE_BODY, GeomGroup
from minexplore.physics.robot import (
    ROCK_BODY,
    RobotParams,
    attach_robot,
    contact_sensor,
    free_joint_qpos,
    separate_contacts,
)
from minexplore.task import TaskParams
from minexplore.world import World

_SHOWN = (GeomGroup.FLOOR, GeomGroup.ROBOT, GeomGroup.ROUGH_SURFACE)


class PlainEnv:
    """The whole world flat in one body, 20 x `mj_step`, `mj_multiRay`, coverage cell by cell in Python."""

    def __init__(self, world: World) -> None:
        """Compile the world."""
        self.task, self.robot, self.world = TaskParams(), RobotParams(), world
        spec = world.spec()
        spec.option.timestep = self.task.physics_s
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        separate_contacts(spec)
        attach_robot(spec, "robot", self.robot)
        spec.body(SURFACE_BODY).name = ROCK_BODY
        contact_sensor(spec, "robot")
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.rng = np.random.default_rng(0)
        self.groups = np.zeros(mujoco.mjNGROUP, dtype=np.uint8)
        self.groups[list(_SHOWN)] = 1
        angles = 2 * np.pi * np.arange(self.task.beams) / self.task.beams
        self.beams = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(self.task.beams)])
        self.inverse = np.linalg.inv(world.T_world_mine)
        self.site, self.body = self.model.site("robot_lidar").id, self.model.body("robot").id
        self.chassis = self.model.geom("robot_chassis").id
        self.reset()

    def reset(self) -> None:
        """Stand the robot at the anchor."""
        mujoco.mj_resetData(self.model, self.data)
        x, y = self.world.record["spawn"]["anchor_m"]
        self.data.qpos[:7] = free_joint_qpos(self.world.T_world_mine, self.robot, x, y, self.rng.uniform(-np.pi, np.pi))
        mujoco.mj_forward(self.model, self.data)
        self.seen: set[tuple[int, int]] = set()

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float]:
        """Drive, look, mark cells, reward."""
        left, right = self.robot.wheel_speeds(action[0] * 1.5, action[1] * 1.5)
        self.data.ctrl[:] = [left, right]
        touched = False
        for _ in range(self.task.substeps):
            mujoco.mj_step(self.model, self.data)
            for contact in self.data.contact:
                touched = touched or self.chassis in (contact.geom1, contact.geom2)
        n, far = self.task.beams, self.task.range_m[1]
        directions = self.beams @ self.data.xmat[self.body].reshape(3, 3).T
        start, hit, distance = self.data.site_xpos[self.site], np.zeros(n, np.int32), np.zeros(n)
        mujoco.mj_multiRay(
            self.model, self.data, start, directions.ravel(), self.groups, True, self.body, hit, distance, None, n, far
        )
        ranges = np.where(distance < 0, far, np.minimum(distance, far))
        before = len(self.seen)
        for direction, reach in zip(directions, ranges, strict=True):
            self._mark(start, start + direction * reach)
        new = len(self.seen) - before
        noisy = ranges + self.rng.normal(0, self.task.range_noise_m, n)
        reward = new * 0.005 - 0.002 * (new == 0) - 15.0 * touched
        return np.concatenate([noisy / far, action, [0.0]]), reward

    def _mark(self, start: np.ndarray, end: np.ndarray) -> None:
        a, b = (self.inverse[:3, :3] @ p + self.inverse[:3, 3] for p in (start, end))
        length = math.hypot(b[0] - a[0], b[1] - a[1])
        for k in range(int(length / 0.5) + 1):
            share = min(1.0, k * 0.5 / max(length, 1e-9))
            x, y = a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
            self.seen.add((int(x // 2.0), int(y // 2.0)))
