"""Steps a second: a robot among all parts, among those within its reach, and in a world of the pipeline."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

from minexplore.physics.local_models import LocalModels
from minexplore.physics.robot import RobotParams, free_joint_qpos, qpos_address
from minexplore.task import TaskParams
from minexplore.world import load_world
from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Label, Volume
from pipeline.volume.world.proof.physics import add_robots, places_for_robots, run_for, spec_of, stand

_FEW_PARTS = 50  # among fewer, testing every pair takes less time than MuJoCo's trees of boxes do
_ASIDE_M, _BELOW_M, _ABOVE_M = 1.6, 0.6, 1.0  # half a tile, the robot's disc and a step's way; a slope; the robot


def local_parts(parts: list[ShellPart], place: np.ndarray) -> list[ShellPart]:
    """Return the parts that a robot in a tile of 2 m about a place can touch in a control step, by their boxes."""
    low = place - np.array([_ASIDE_M, _ASIDE_M, _BELOW_M])
    high = place + np.array([_ASIDE_M, _ASIDE_M, _ABOVE_M])
    return [p for p in parts if (p.corners.min(axis=0) < high).all() and (p.corners.max(axis=0) > low).all()]


class Driver:
    """A robot that drives in small circles about a place of its model; `rate` times it."""

    def __init__(self, model: mujoco.MjModel, place: Callable[[mujoco.MjData], None]) -> None:
        """Take a model with one robot and what puts it at its start."""
        self._model, self._place, self._data = model, place, mujoco.MjData(model)

    def rate(self, seed: int, steps: int = 1000) -> float:
        """Return the physics steps a second."""
        rng = np.random.default_rng(seed)
        mujoco.mj_resetData(self._model, self._data)
        self._place(self._data)
        run_for(self._model, self._data, 0.5)
        start = time.process_time()
        for _ in range(steps // 20):
            self._data.ctrl[:] = np.array(
                RobotParams().wheel_speeds(rng.uniform(0.1, 0.4, 1), rng.choice([-1.5, 1.5], 1))
            ).ravel()
            mujoco.mj_step(self._model, self._data, 20)
        return steps / (time.process_time() - start)


def drivers(volume: Volume, parts: list[ShellPart], rng: np.random.Generator) -> tuple[dict[str, Driver], int]:
    """Return a robot among all parts and one among those within its reach, at one random place, and how many these are.

    The place is the one with the median number of parts among nine.
    """
    places, normals = places_for_robots(volume)
    some = rng.integers(len(places), size=9)
    chosen = sorted(((local_parts(parts, places[k]), int(k)) for k in some), key=lambda pair: len(pair[0]))
    near, k = chosen[len(chosen) // 2]
    found: dict[str, Driver] = {}
    for name, rock in (("all", parts), ("local", near)):
        spec = spec_of(rock, add_robots(1), volume.label == Label.FLOOR if name == "local" else None)
        if name == "local" and len(rock) <= _FEW_PARTS:
            spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
        model = spec.compile()

        def place(data: mujoco.MjData, model: mujoco.MjModel = model) -> None:
            stand(data, model, "r0", places[k], normals[k], 0.0)

        found[name] = Driver(model, place)
    return found, len(near)


def world_driver(bundle: Path) -> Driver:
    """Return a robot at the start of a world that the pipeline built, in the environment's local model there."""
    world, robot = load_world(bundle), RobotParams()
    models = LocalModels(world, TaskParams(), robot)
    x, y = (float(v) for v in world.record["spawn"]["anchor_m"][:2])
    tile = tuple(int(v) for v in models.tiles_of(np.array([[x, y]]))[0])
    model = models.model(tile)  # type: ignore[arg-type]
    at = qpos_address(model, "robot")[:7]

    def place(data: mujoco.MjData) -> None:
        data.qpos[at] = free_joint_qpos(models.T_world_mine, robot, x, y, 0.0)

    return Driver(model, place)
