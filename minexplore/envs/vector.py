"""The exploration task for many robots at once, natively: one call steps them all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from minexplore.envs.batches import commands_of, make_batch, observations_of
from minexplore.envs.call_checks import check_camera, check_options, numbers_of, spread_seeds
from minexplore.envs.horizon import Timed
from minexplore.envs.vector_rows import mask_of, merge_infos, spread_info
from minexplore.physics.robots import RobotChoice, find_robot
from minexplore.sensing.lidar import Backend
from minexplore.sensing.params import SensorParams, sensor_params
from minexplore.sensors.table import check_sensors, observed_space
from minexplore.task import LONG, TaskParams, coerce_params
from minexplore.tasks.exploration import StepOutcome
from minexplore.world import find_world, load_world

if TYPE_CHECKING:
    from minexplore.envs.sensed.sensed_rows import SensedRows
    from minexplore.pictures.render import Renderer
    from minexplore.tasks.goto import GoalParams

_MOST = 65_536  # robots, or threads


class MineVectorEnv(Timed, VectorEnv, gymnasium.utils.EzPickle):
    """`num_envs` robots, each alone in its own copy of the mine; see `MineEnv` for the task.

    The trajectories are those of `MineEnv` with the same seeds and actions, bit for bit.

    Parameters
    ----------
    num_envs : int
    world, task, robot, camera, lidar, whole, pose, conditions, goal
        As in `MineEnv`.
    render_mode : {None, "rgb_array"}
        `render` gives one picture a robot.
    autoreset_mode : AutoresetMode or str
        `NEXT_STEP` (default): the step after an episode's last one resets and ignores the action. `SAME_STEP`: the last
        step resets at once; the last observation and info are in `info["final_obs"]`, `info["final_info"]`. `DISABLED`:
        `reset(options={"reset_mask": ...})` resets robots whose episode ended; `step` refuses to go on before.
    max_episode_steps : int, optional
        Instead of the task's `max_steps`; `gymnasium.make_vec` gives that of the id.
    threads : int
        That step the physics.
    sensors : sequence of str
        As in `MineEnv`: the observation is then a dict of batches. Each robot reads them one after the other.
    """

    closed = True  # until there is something to close: Gymnasium closes what goes out of use, half-made ones too

    def __init__(
        self,
        num_envs: int = 1,
        world: str | Path | None = None,
        task: TaskParams | dict[str, Any] | None = None,
        robot: RobotChoice = None,
        render_mode: str | None = None,
        camera: str = "chase",
        lidar: Backend = "auto",
        whole: bool = False,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int = 1,
        pose: str = "true",
        conditions: SensorParams | Mapping[str, Any] | str | None = None,
        sensors: Sequence[str] = (),
        max_episode_steps: int | None = None,
        goal: GoalParams | Mapping[str, Any] | None = None,
    ) -> None:
        """Load the world and put the robots into it."""
        given = (num_envs, world, task, robot, render_mode, camera, lidar, whole, autoreset_mode, threads)
        gymnasium.utils.EzPickle.__init__(self, *given, pose, conditions, sensors, max_episode_steps, goal)
        check_count("num_envs", num_envs, _MOST)
        check_count("threads", threads, _MOST)
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode = {render_mode!r}: valid choices are None, 'rgb_array'")
        check_camera(camera)
        mode = find_mode(autoreset_mode)
        self.num_envs, self.render_mode, self.camera, self.autoreset_mode = num_envs, render_mode, camera, mode
        self.metadata = {"render_modes": ["rgb_array"], "render_fps": 10, "autoreset_mode": mode}
        if render_mode is not None:
            from minexplore.pictures.opengl import prepare_opengl

            prepare_opengl(render_mode)
        self.task = task_of(task, max_episode_steps)
        self.robot: Any = find_robot(robot)  # a `Robot`; policies are typed for those of one kind
        self.world = load_world(find_world(world))
        batch = (self.world, self.task, self.robot, num_envs, threads, lidar, whole)
        self.sensors, conditions = check_sensors(sensors), sensor_params(conditions)
        self.robots = make_batch(*batch, pose, conditions, goal)
        own = observations_of(self.task, self.robot, goal, self.world.has_heights)
        self.single_observation_space = observed_space(own, self.sensors)
        self.single_action_space = commands_of(self.robot)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._rngs: list[np.random.Generator] = []
        self._seeds: list[int] = []
        self._begun = False
        self._ended = np.zeros(num_envs, dtype=bool)
        self._observation: np.ndarray = np.zeros((num_envs, *own.shape), np.float32)
        self._renderer: Renderer | None = None
        self._sensed: SensedRows | None = None
        if self.sensors:
            from minexplore.envs.sensed.sensed_rows import SensedRows

            self._sensed = SensedRows(self.robots, self.sensors, self._drawing, conditions, lidar)
        self.closed = False

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Reset all robots, or those of `options["reset_mask"]`; an int seed gives robot i the seed `seed + i`.

        Options that say where an episode starts hold for each of these robots; see `MineEnv.reset`.
        """
        self._require_open()
        check_options(options, ("reset_mask", *self.robots.rules.OPTIONS))
        seeds, mask = spread_seeds(seed, self.num_envs), mask_of(options, self.num_envs)
        if not self._begun and not mask.all():
            raise gymnasium.error.ResetNeeded("reset_mask: reset all robots before some of them")
        start = self.robots.rules.start_of(options)
        self._draw_seeds()
        for i in np.flatnonzero(mask).tolist():
            if seeds[i] is not None:
                self._rngs[i], self._seeds[i] = seeding.np_random(seeds[i])
        self._begun = True
        self._ended[mask] = False
        outcome = self.robots.reset(np.flatnonzero(mask), self._rngs, start)
        noise = None if start is None or start.noise_seed is None else start.noise_seed
        self._take(outcome, np.flatnonzero(mask), seeds if noise is None else range(noise, noise + self.num_envs))
        return self._observed(), spread_info(outcome, np.flatnonzero(mask), self.num_envs)

    def _take(self, outcome: StepOutcome, rows: np.ndarray, seeds: Sequence[int | None] | None = None) -> None:
        """Take observations and readings of robots (k,), which begin episodes of `seeds` (n,) or have made a step."""
        self._observation[rows] = outcome.observation
        if self._sensed is not None:
            self._sensed.take(rows, seeds)

    def _observed(self, rows: Any = slice(None)) -> Any:
        """Return a copy of the observations of robots, of all by default: an array, or with sensors a dict of them."""
        own = self._observation[rows].copy()
        if self._sensed is None:
            return own
        return {"robot": own, **{name: found[rows].copy() for name, found in self._sensed.readings.items()}}

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """Return the seed of each robot's random numbers, as `SyncVectorEnv` does."""
        self._draw_seeds()
        return tuple(self._seeds)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """Return each robot's random numbers."""
        self._draw_seeds()
        return tuple(self._rngs)

    def _draw_seeds(self) -> None:
        """Give robots that have none yet random numbers by seeds of the system's."""
        for _ in range(self.num_envs - len(self._rngs)):
            rng, seed = seeding.np_random(None)
            self._rngs.append(rng)
            self._seeds.append(seed)

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Step all robots; robots whose episode ended are reset as `autoreset_mode` says."""
        self._require_open()
        actions = numbers_of(actions)
        if not self._begun:
            raise gymnasium.error.ResetNeeded("call reset before step")
        over = np.flatnonzero(self._ended)
        if len(over) and self.autoreset_mode is AutoresetMode.DISABLED:
            raise gymnasium.error.ResetNeeded(f"robot {over[0]}: its episode ended; reset it by options['reset_mask']")
        driving = np.flatnonzero(~self._ended)
        reward, (terminated, truncated) = np.zeros(self.num_envs), np.zeros((2, self.num_envs), dtype=bool)
        info: dict[str, Any] = {}
        if len(driving):
            now = self.robots.step(actions, self._rngs, driving if len(over) else None)
            self._take(now, driving)
            reward[driving] = now.reward
            terminated[driving], truncated[driving] = now.terminated, now.truncated
            info = spread_info(now, driving, self.num_envs)
        if len(over):
            started = self.robots.reset(over, self._rngs)
            self._take(started, over, [None] * self.num_envs)
            info = merge_infos(info, spread_info(started, over, self.num_envs), over)
        self._ended = terminated | truncated
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._ended.any():
            info |= self._restart(np.flatnonzero(self._ended), info)
        return self._observed(), reward, terminated, truncated, info

    def _restart(self, over: np.ndarray, info: dict[str, Any]) -> dict[str, Any]:
        """Reset robots at once, and hand on what they last saw."""
        last = np.full(self.num_envs, None, dtype=object)
        for i in over.tolist():
            last[i] = self._observed(i)
        ended = np.isin(np.arange(self.num_envs), over)
        final = {k: v.copy() for k, v in info.items() if not k.startswith("_")}
        final |= {f"_{k}": ended.copy() for k in final}
        started = self.robots.reset(over, self._rngs)
        self._take(started, over, [None] * self.num_envs)
        self._ended[:] = False
        merged = merge_infos(info, spread_info(started, over, self.num_envs), over)
        return {**merged, "final_obs": last, "_final_obs": ended, "final_info": final, "_final_info": ended.copy()}

    def render(self) -> tuple[np.ndarray, ...] | None:  # type: ignore[override]
        """Return one picture (480, 640, 3) uint8 a robot in mode `rgb_array`, else None."""
        self._require_open()
        if not self._begun:
            raise gymnasium.error.ResetNeeded("call reset before render")
        if self.render_mode is None:
            return None
        robots, drawing, poses = self.robots, self._drawing(), self.robots.poses()
        return tuple(
            drawing.draw(self.camera, robots.qpos[i : i + 1], robots.seen[i], poses[i : i + 1])
            for i in range(self.num_envs)
        )

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Return what `render` gives, or an attribute once a robot, as Gymnasium's other vectors do."""
        found = self.render() if name == "render" else getattr(self, name)
        if callable(found):
            raise ValueError(f"call: {name!r:.80}: robots have no methods of their own; want render or an attribute")
        return found if isinstance(found, tuple) and name == "render" else (found,) * self.num_envs

    def _drawing(self) -> Renderer:
        if self._renderer is None:
            from minexplore.pictures.render import Renderer

            self._renderer = Renderer(self.world, self.robots.T_world_mine, self.robots.grid, self.robot, 1)
        return self._renderer

    def close_extras(self, **kwargs: Any) -> None:
        """Free renderer and threads."""
        if self._renderer is not None:
            self._renderer.close()
        if self._sensed is not None:
            self._sensed.close()
        self.robots.close()

    def _require_open(self) -> None:
        if self.closed:
            raise gymnasium.error.ClosedEnvironmentError("the environment is closed: make another one")

    def __getstate__(self) -> dict[str, Any]:
        """Return the arguments and all that has changed since; a copy goes on as this environment does."""
        names = ("_rngs", "_seeds", "_begun", "_ended", "_observation", "closed", "_spec")
        changed = {name: getattr(self, name) for name in names}
        sensed = None if self._sensed is None else self._sensed.copy_state()
        return {**super().__getstate__(), "changed": changed, "robots": self.robots.copy_state(), "sensed": sensed}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the environment from its arguments and bring it into its state."""
        super().__setstate__(state)
        self.robots.restore_state(state["robots"])
        if self._sensed is not None:
            self._sensed.restore_state(state["sensed"])
        if state["changed"]["closed"]:
            self.close()
        self.__dict__.update(state["changed"])


def check_count(name: str, value: Any, most: int) -> None:
    """Refuse a number of robots or threads that is no whole number from 1 to `most`."""
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or not 1 <= value <= most:
        raise ValueError(f"{name} = {value!r}: want a whole number from 1 to {most}")


def find_mode(mode: AutoresetMode | str) -> AutoresetMode:
    """Return an autoreset mode given by itself, its name or its value."""
    for known in AutoresetMode:
        if mode in (known, known.name, known.value):
            return known
    raise ValueError(f"autoreset_mode = {mode!r}: valid choices are {', '.join(AutoresetMode.__members__)}")


def task_of(task: TaskParams | dict[str, Any] | None, max_episode_steps: int | None) -> TaskParams:
    """Return a vector's task, which ends after `max_episode_steps` where they are given."""
    found = coerce_params(TaskParams, task)
    if max_episode_steps is None:
        return found
    check_count("max_episode_steps", max_episode_steps, LONG)
    return replace(found, max_steps=int(max_episode_steps))
