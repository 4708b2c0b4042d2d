"""Robots that drive in a volume and in the level mine, stepped alike, with what a control step costs."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from benchmarks.comparisons.volume.local.in_memory import VolumeStepping
from benchmarks.speed.time_env import start_spread
from minexplore.envs.vector import MineVectorEnv
from minexplore.physics.robot_kind import DrivenRobot
from minexplore.physics.stepper import PhysicsStepper
from minexplore.rotations import rotation_matrices
from minexplore.volume.choice import StepChoice
from minexplore.volume.models import FEET, code_of
from pipeline.volume.rock.inside import Inside
from pipeline.volume.union import Volume
from pipeline.volume.world.proof.physics import places_for_robots, stand

ROBOTS, STEPS = 32, 30
_APART = 3  # control steps of which one is stepped again, those apart that touched rock
_THROWN_STEPS = 8
_LOOK_M = 0.15  # over a foot: a floor under it begins below
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


@dataclass(frozen=True)
class StepCost:
    """Microseconds of a robot's control step: choosing its model and planes, physics, and of the level mine the rest.

    Shares of the control steps with a foot on the floor's parts, and with a chassis that touched rock. `contact_us` is
    how much longer the physics of a step takes that touches rock.
    """

    choice_us: float
    physics_us: float
    rest_us: float = 0.0
    parts_share: float = 0.0
    touch_share: float = 0.0
    contact_us: float = 0.0

    @property
    def total_us(self) -> float:
        """Return the whole step."""
        return self.choice_us + self.physics_us + self.rest_us


@dataclass(frozen=True)
class Thrown:
    """Robots thrown, control steps in which their chassis touched rock, and how many are outside in the end.

    `floor_error_m` is the largest distance in height of a plane from the floor under its foot.
    """

    throws: int
    touches: int
    escapes: int
    floor_error_m: float


class VolumeDrive:
    """Robots that drive in a volume, each alone, stepped by the environment's `PhysicsStepper`."""

    def __init__(self, volume: Volume, local: VolumeStepping, rng: np.random.Generator) -> None:
        """Choose places on the floors, by their area."""
        places, normals = places_for_robots(volume)
        area = _areas_at(volume, places)
        chosen = rng.choice(len(places), ROBOTS, p=area / area.sum())
        self._volume = volume
        self._local, self.models, self.chooser = local, local.models, local.chooser
        self._zones = np.zeros((ROBOTS, 2), int)
        number, code = self.models.number_of(places[chosen[:1]], False), code_of(np.zeros(1, int), self._zones[:1])
        self.stepper = PhysicsStepper(self.models, ROBOTS, 1, np.append(number, code))  # type: ignore[arg-type]
        model = self.models.model((int(number[0]), int(code[0])))
        self._where, self._how = _mocap_addresses(model)
        data = mujoco.MjData(model)
        self._starts = np.zeros((ROBOTS, 7))
        for k, number in enumerate(chosen):
            at = stand(data, model, "robot", places[number], normals[number], rng.uniform(-np.pi, np.pi))
            self._starts[k] = data.qpos[at : at + 7]

    def reset(self) -> None:
        """Put all robots back to their starts."""
        for k in range(ROBOTS):
            self.stepper.restart(k)
        self.stepper.qpos[:, :7] = self._starts

    def step(self, action: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """Step all robots; return the seconds of the choice, which robots stood on parts, and which touched rock."""
        start = time.process_time()
        choice = self._last = self._chosen(action)
        chosen = time.process_time() - start
        on_parts = np.asarray((~choice.on_plane).any(axis=1))
        substeps = self.models.task.substeps
        return chosen, on_parts, self.stepper.advance(np.arange(ROBOTS), choice.tiles, substeps)

    def _chosen(self, action: np.ndarray) -> StepChoice:
        """Choose the models and planes of all robots, and enter these and the controls in their states."""
        task, robot, stepper = self.models.task, self.models.robot, self.stepper
        assert isinstance(robot, DrivenRobot)
        stepper.ctrl[:] = robot.controls(action[:, 0] * task.max_forward_mps, action[:, 1] * task.max_turn_radps)
        qpos = stepper.qpos
        choice = self.chooser.choose(qpos[:, :3], qpos[:, 3:7], stepper.qvel[:, :6], self._zones)
        stepper.state[:, self._where] = choice.places.reshape(ROBOTS, -1)
        stepper.state[:, self._how] = choice.quaternions.reshape(ROBOTS, -1)
        return choice

    def throw(self, rounds: int, rng: np.random.Generator) -> Thrown:
        """Throw all robots in all directions again and again, and drive them on at full throttle."""
        inside, robots, touches, escapes, errors = Inside(self._volume), self.stepper, 0, 0, [0.0]
        for _ in range(rounds):
            self.reset()
            yaw, speed = rng.uniform(-np.pi, np.pi, ROBOTS), rng.uniform(0, self.models.task.max_forward_mps, ROBOTS)
            robots.qvel[:, :2] = speed[:, None] * np.column_stack([np.cos(yaw), np.sin(yaw)])
            action = np.column_stack([np.ones(ROBOTS), rng.uniform(-1, 1, ROBOTS)])
            for _step in range(_THROWN_STEPS):
                _, _, touched = self.step(action)
                touches += int(touched.sum())
                errors.append(self._floor_error_m())
            escapes += int((inside.distance_m(robots.qpos[:, :3]) < 0).sum())
        return Thrown(rounds * ROBOTS, touches, escapes, max(errors))

    def _floor_error_m(self) -> float:
        """Return how far in height the planes of the last step are from the floor under the feet that it ended with."""
        qpos, on_plane = self.stepper.qpos, self._last.on_plane
        feet = self.chooser.feet_of(qpos[:, :3], rotation_matrices(qpos[:, 3:7]))
        floor = self._local.floors_under(feet[on_plane] + np.array([0, 0, _LOOK_M]))
        off = np.abs(self._last.under.heights(feet[..., :2])[on_plane] - floor)
        return float(np.nanmax(off, initial=0.0))

    def cost(self, actions: np.ndarray) -> StepCost:
        """Return the cost of driving from the starts."""
        self.reset()
        start = time.process_time()
        chosen, on_parts, touched = zip(*(self.step(action) for action in actions), strict=True)
        physics = time.process_time() - start - sum(chosen)
        each = 1e6 / (ROBOTS * len(actions))
        shares = float(np.mean(on_parts)), float(np.mean(touched))
        return StepCost(each * sum(chosen), each * physics, 0.0, *shares, self._contact_us(actions))

    def _contact_us(self, actions: np.ndarray) -> float:
        """Return how much longer the physics of a robot's step takes that touches rock, us, by steps done again."""
        self.reset()
        seconds, count = np.zeros(2), np.zeros(2, int)
        for number, action in enumerate(actions):
            before = self.stepper.state.copy()
            _, _, touched = self.step(action)
            after = self.stepper.state.copy()
            for kind, robots in enumerate((np.flatnonzero(~touched), np.flatnonzero(touched))):
                if number % _APART == 0 and len(robots):
                    self.stepper.state[:] = before
                    choice, start = self._chosen(action), time.process_time()
                    self.stepper.advance(robots, choice.tiles[robots], self.models.task.substeps)
                    seconds[kind] += time.process_time() - start
                    count[kind] += len(robots)
            self.stepper.state[:] = after
        free, touching = 1e6 * seconds / np.maximum(count, 1)
        return float(touching - free) if count.all() else 0.0


def _areas_at(volume: Volume, places: np.ndarray) -> np.ndarray:
    """Return the area (n,) m2 of the facet that each place is the middle of."""
    middles = {
        tuple(m): a
        for m, a in zip(
            volume.vertices[volume.faces].mean(axis=1), np.linalg.norm(volume.normals, axis=1) / 2, strict=True
        )
    }
    return np.array([middles[tuple(place)] for place in places])


def _mocap_addresses(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """Return where the places and the quaternions of the planes' bodies stand in the integration state."""
    data, state = mujoco.MjData(model), np.zeros(mujoco.mj_stateSize(model, _STATE))
    data.mocap_pos[:], data.mocap_quat[:] = np.pi, np.e
    mujoco.mj_getState(model, data, state, _STATE)
    where, how = np.flatnonzero(state == np.pi), np.flatnonzero(state == np.e)
    assert (len(where), len(how)) == (3 * len(FEET), 4 * len(FEET))
    return where, how


class LevelDrive:
    """The level mine's environment with as many robots, spread over it; its physics is timed apart."""

    def __init__(self, world: Path) -> None:
        """Make the environment."""
        self._env = MineVectorEnv(ROBOTS, world)
        self._physics_s = 0.0
        advance = self._env.robots.stepper.advance

        def timed(robots: np.ndarray, places_m: np.ndarray, steps: int) -> np.ndarray:
            start = time.process_time()
            touched = advance(robots, places_m, steps)
            self._physics_s += time.process_time() - start
            return touched

        self._env.robots.stepper.advance = timed  # type: ignore[method-assign]

    def cost(self, actions: np.ndarray) -> StepCost:
        """Return the cost of driving from the starts."""
        start_spread(self._env)
        self._physics_s, start = 0.0, time.process_time()
        touched = [self._env.step(action)[4]["collision"].mean() for action in actions]
        whole, each = time.process_time() - start, 1e6 / (ROBOTS * len(actions))
        return StepCost(0.0, each * self._physics_s, each * (whole - self._physics_s), 0.0, float(np.mean(touched)))


def hard_driving(rng: np.random.Generator) -> np.ndarray:
    """Return actions (steps, robots, 2) as `benchmarks.speed.time_env` has them."""
    some = np.stack([rng.uniform(0.3, 1, (9, ROBOTS)), rng.uniform(-1, 1, (9, ROBOTS))], axis=2)
    return some[np.arange(STEPS) // 10 % 9]
