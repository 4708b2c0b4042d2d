"""Physics of a team: all robots and all rock in one model, which one call steps."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from minexplore.bundle import GeomGroup
from minexplore.physics.robot import ROBOT_BIT
from minexplore.physics.robot_kind import Robot
from minexplore.world import World

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class TeamStepper:
    """Steps robots that touch each other, as `PhysicsStepper` steps those that are alone.

    `qpos`, `qvel` and `ctrl` have a row for each robot and are views of the one model's `data`.
    """

    def __init__(self, world: World, models: Any, robot: Robot, count: int) -> None:
        """Compile a world with so many robots; `models` is what a `RobotGround` has."""
        self.names = tuple(f"robot_{i}" for i in range(count))
        spec = models.spec(None, self.names)
        for name in self.names:
            _let_meet(spec, name, robot)
        self.model = world.compile(spec)
        self.data = mujoco.MjData(self.model)
        self._rest = self.model.qpos0.reshape(count, -1)
        self.qpos, self.qvel = self.data.qpos.reshape(count, -1), self.data.qvel.reshape(count, -1)
        self.ctrl, self.state = self.data.ctrl.reshape(count, -1), self.qpos
        body = np.array([self.model.body(name).id for name in self.names])
        self._bodies, self._robot_of = body, np.full(self.model.nbody, -1)
        self._robot_of[body] = np.arange(count)

    def restart(self, robot: int) -> None:
        """Bring a robot to rest where the model has it."""
        self.qpos[robot], self.qvel[robot] = self._rest[robot], 0.0

    def advance(self, robots: np.ndarray, places_m: np.ndarray, steps: int) -> np.ndarray:
        """Advance all robots; return which of robots (k,) touched rock (k,) bool.

        Raises
        ------
        RuntimeError
            If MuJoCo warns of the physics.
        """
        touched = np.zeros(len(self.names), dtype=bool)
        for _ in range(steps):
            mujoco.mj_step(self.model, self.data)
            touched |= self.data.sensordata > 0
        if self.data.warning.number.any():
            raise RuntimeError(f"team: MuJoCo warns of its physics at {self.data.time:g} s")
        return touched[robots]

    def strike(self, robot: int, origins: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return distances (n,) m to robots but one, inf for none, and the normals (n, 3) there.

        Unit rays (n, 3) start at one place (3,) m, or at places (n, 3) m; all are of the world frame.
        """
        mujoco.mj_kinematics(self.model, self.data)
        group = np.zeros(mujoco.mjNGROUP, np.uint8)
        group[GeomGroup.ROBOT] = 1
        count = len(ways)
        geom, found, normal = np.full(count, -1, np.int32), np.full(count, -1.0), np.zeros((count, 3))
        body = int(self._bodies[robot])
        for rays in [slice(0, count)] if origins.ndim == 1 else [slice(k, k + 1) for k in range(count)]:
            origin, own = origins if origins.ndim == 1 else origins[rays.start], (geom[rays], found[rays])
            flat = ways[rays].ravel(), normal[rays].reshape(-1)
            mujoco.mj_multiRay(
                *(self.model, self.data, origin, flat[0], group, False, body, *own, flat[1]),
                *(rays.stop - rays.start, mujoco.mjMAXVAL),
            )
        others = self.model.body_rootid[self.model.geom_bodyid[geom]] != body
        return np.where((geom >= 0) & others, found, np.inf), normal

    def copy_state(self) -> np.ndarray:
        """Return a copy of the integration state of the whole model."""
        state = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, state, _STATE)
        return state

    def restore_state(self, state: np.ndarray) -> None:
        """Take what `copy_state` returned."""
        mujoco.mj_setState(self.model, self.data, state, _STATE)

    def close(self) -> None:
        """Free nothing: there are no threads."""


def _let_meet(spec: mujoco.MjSpec, name: str, robot: Robot) -> None:
    """Let other robots touch a robot's disc as a sphere, and see its chassis."""
    chassis = spec.geom(f"{name}_chassis")
    chassis.group = GeomGroup.ROBOT
    if spec.geom(f"{name}_bumper") is None:
        spec.body(name).add_geom(
            name=f"{name}_bumper",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[robot.radius_m, 0, 0],
            pos=chassis.pos,
            mass=0,
            group=GeomGroup.SMOOTH_SURFACE,
            contype=ROBOT_BIT,
            conaffinity=ROBOT_BIT,
            friction=chassis.friction,
        )
