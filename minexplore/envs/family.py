"""Exploration of unseen mines: every episode is in another mine of a split of the generated family."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, get_args

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from minexplore.envs.batches import commands_of, observations_of
from minexplore.envs.call_checks import (
    check_camera,
    check_mode,
    check_options,
    check_pose,
    numbers_of,
    one_seed,
    spread_seeds,
)
from minexplore.envs.env import MineEnv
from minexplore.envs.horizon import Timed
from minexplore.envs.vector import check_count, find_mode, task_of
from minexplore.envs.vector_rows import mask_of
from minexplore.limits import has_display
from minexplore.physics.robots import find_robot
from minexplore.sensing.lidar import Backend
from minexplore.sensing.params import sensor_params
from minexplore.sensors.table import check_sensors, observed_space
from minexplore.splits import SIZES, mine_name, parse_name, world_folder
from minexplore.task import TaskParams, coerce_params
from minexplore.tasks.exploration import STARTS
from minexplore.world import World

_MOST = 4096  # robots of a vector: each has a world of its own in memory


class FamilyEnv(Timed, gymnasium.Env, gymnasium.utils.EzPickle):
    """Explore a mine that is drawn anew at every reset; see `MineEnv` for the task.

    The seed of `reset` decides about the mine and the episode in it. Mines are drawn with equal chance, and which one
    does not depend on the mines that are built: a drawn mine that is not built is an error.

    Parameters
    ----------
    split : {"train", "validation", "test"}
        1,000, 50 or 200 mines of four styles. Policies are chosen on `validation` and compared on `test`.
    mines : sequence of str or int, optional
        Draw among these names (`test-0007`), or among the first so many mines of the split.
    families : path, optional
        Where the worlds are; `artifacts/families` of a source checkout by default.
    **arguments
        Of `MineEnv`, without `world`.

    Notes
    -----
    `reset(options={"mine": "test-0007"})` enters one of the mines. The info holds the mine's number in
    its split as `mine`, and the attribute `mine` is its name.
    """

    metadata = MineEnv.metadata

    def __init__(
        self,
        split: str = "train",
        mines: Sequence[str] | int | None = None,
        families: str | Path | None = None,
        **arguments: Any,
    ) -> None:
        """Check the names; worlds are loaded when an episode begins in them."""
        gymnasium.utils.EzPickle.__init__(self, split, mines, families, **arguments)
        if "world" in arguments:
            raise ValueError("world: a family draws its worlds; make MineXplore/World-v0 for one of your own")
        if families is not None and not isinstance(families, str | Path):
            raise ValueError(f"families = {families!r}: want the path of a folder")
        check_arguments(arguments)
        self.names = _names(split, mines)
        self._families = None if families is None else Path(families)
        self._arguments = arguments
        self.render_mode = arguments.get("render_mode")
        modes = ["rgb_array", "human"] if has_display() else ["rgb_array"]
        self.metadata = {**MineEnv.metadata, "render_modes": modes}  # of its own: `SyncVectorEnv` writes its mode there
        self.task = coerce_params(TaskParams, arguments.get("task"))
        self.robot, sensors = find_robot(arguments.get("robot")), check_sensors(arguments.get("sensors", ()))
        goal = arguments.get("goal")
        self._options = _options_of(goal)
        self.observation_space = observed_space(observations_of(self.task, self.robot, goal), sensors)
        self.action_space = commands_of(self.robot)
        self.mine: str | None = None
        self._inner: MineEnv | None = None
        self._closed = False

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Draw a mine, or enter `options["mine"]`, and begin an episode in it.

        Raises
        ------
        FileNotFoundError
            If the mine is not built; the message says how to build it.
        ValueError
            If the options name a mine that this environment does not draw.
        """
        if self._closed:
            raise gymnasium.error.ClosedEnvironmentError("the environment is closed: make another one")
        check_options(options, ("mine", *self._options))
        super().reset(seed=one_seed(seed))
        drawn = self.names[self.np_random.integers(len(self.names))]
        starts = dict(options or {})
        inner = self._enter(starts.pop("mine", drawn))
        observation, info = inner.reset(seed=int(self.np_random.integers(2**31)), options=starts)
        return observation, self._with_mine(info)

    def _enter(self, name: str) -> MineEnv:
        if not isinstance(name, str) or name not in self.names:
            raise ValueError(f"options: mine = {name!r}: want one of {self.names[0]} to {self.names[-1]}")
        if self._inner is None or name != self.mine:
            entered = MineEnv(world_folder(name, self._families), **{**self._arguments, "task": self.task})
            if self._inner is not None:
                self._inner.close()
            self.mine, self._inner = name, entered
        return self._inner

    def step(self, action: np.ndarray) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Drive for one control step; see `MineEnv.step`."""
        observation, reward, terminated, truncated, info = self._begun("step").step(action)
        return observation, reward, terminated, truncated, self._with_mine(info)

    def _with_mine(self, info: dict[str, Any]) -> dict[str, Any]:
        return {**info, "mine": np.array(parse_name(str(self.mine))[1])}

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """Return a picture of the present mine in mode `rgb_array`, else None."""
        return None if self.render_mode != "rgb_array" else self._begun("render").render()

    def capture(self, sensor: str) -> Any:
        """Return what a sensor reads in the present mine; see `MineEnv.capture`."""
        return self._begun("capture").capture(sensor)

    @property
    def world(self) -> World:
        """Return the present mine."""
        return self._begun("asking for the world").world

    def _begun(self, call: str) -> MineEnv:
        if self._closed:
            raise gymnasium.error.ClosedEnvironmentError("the environment is closed: make another one")
        if self._inner is None:
            raise gymnasium.error.ResetNeeded(f"call reset before {call}")
        return self._inner

    def close(self) -> None:
        """Free the present mine; the environment cannot be used afterwards."""
        self._closed = True
        if self._inner is not None:
            self._inner.close()

    def __getstate__(self) -> dict[str, Any]:
        """Return the arguments and all that has changed since; a copy goes on as this environment does."""
        names = ("mine", "_inner", "_closed", "_np_random", "_np_random_seed", "_spec", "task")
        return {**super().__getstate__(), "changed": {name: getattr(self, name) for name in names}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the environment from its arguments and bring it into its state."""
        super().__setstate__(state)
        self.__dict__.update(state["changed"])


class FamilyVectorEnv(Timed, SyncVectorEnv):
    """`num_envs` robots, each in a mine of its own, which is drawn anew for each of its episodes; see `FamilyEnv`.

    Robot i behaves as `FamilyEnv` with the seed `seed + i`. Robots share no mine, so that nothing is gained by stepping
    them together; processes of their own (`vectorization_mode="async"`) are faster on several cores.
    """

    def __init__(
        self,
        num_envs: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        **arguments: Any,
    ) -> None:
        """Make the environments; `arguments` are those of `FamilyEnv`, and the others as of `MineVectorEnv`."""
        check_count("num_envs", num_envs, _MOST)
        self.task = task_of(arguments.pop("task", None), max_episode_steps)
        made = partial(FamilyEnv, **arguments, task=self.task)
        super().__init__([made] * int(num_envs), autoreset_mode=find_mode(autoreset_mode))
        self._options = _options_of(arguments.get("goal"))
        self._begun = False

    def reset(  # type: ignore[override]
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Draw a mine for each robot, or for those of `options["reset_mask"]`; `options["mine"]` names one for all."""
        self._require_open()
        check_options(options, ("mine", "reset_mask", *self._options))
        seeds, mask = spread_seeds(seed, self.num_envs), mask_of(options, self.num_envs)
        if not self._begun and not mask.all():
            raise gymnasium.error.ResetNeeded("reset_mask: reset all robots before some of them")
        given = {name: value for name, value in (options or {}).items() if name != "reset_mask"}
        if not mask.all():
            given["reset_mask"] = mask
        found: tuple[np.ndarray, dict[str, Any]] = super().reset(seed=seeds, options=given or None)
        self._begun = True
        return found

    def step(  # type: ignore[override]
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Step all robots; see `FamilyEnv.step`."""
        self._require_open()
        over = np.flatnonzero(self._autoreset_envs)
        if len(over) and self.autoreset_mode is AutoresetMode.DISABLED:
            raise gymnasium.error.ResetNeeded(f"robot {over[0]}: its episode ended; reset it by options['reset_mask']")
        commands = numbers_of(actions)
        if commands.shape != self.action_space.shape:
            raise ValueError(f"actions of shape {commands.shape}: want {self.action_space.shape}")
        return super().step(commands)

    def _require_open(self) -> None:
        if self.closed:
            raise gymnasium.error.ClosedEnvironmentError("the environment is closed: make another one")


def check_arguments(arguments: Mapping[str, Any]) -> None:
    """Refuse arguments of `MineEnv` beside `world` that are unknown or have an impossible value.

    Raises
    ------
    ValueError
        Naming the argument, its value and what is accepted.
    """
    known = list(inspect.signature(MineEnv).parameters)[1:]
    unknown = [name for name in arguments if name not in known]
    if unknown:
        raise ValueError(f"{unknown[0]}: unknown argument; there are {', '.join(known)}")
    check_mode(arguments.get("render_mode"))
    check_camera(arguments.get("camera", "chase"))
    lidar = arguments.get("lidar", "auto")
    if not isinstance(lidar, str) or lidar not in get_args(Backend):
        raise ValueError(f"lidar = {lidar!r}: want {', '.join(get_args(Backend))}")
    if not isinstance(arguments.get("whole", False), bool | np.bool_):
        raise ValueError(f"whole = {arguments['whole']!r}: want True or False")
    check_pose(arguments.get("pose", "true"))
    check_sensors(arguments.get("sensors", ()))
    sensor_params(arguments.get("conditions"))
    coerce_params(TaskParams, arguments.get("task"))
    find_robot(arguments.get("robot"))
    if arguments.get("goal") is not None:
        from minexplore.tasks.goto import GoalParams

        coerce_params(GoalParams, arguments["goal"])


def _options_of(goal: object) -> tuple[str, ...]:
    """Return the options of a reset, beside the mine, in a task with or without a goal."""
    return STARTS if goal is None else (*STARTS, "goal")


def _names(split: str, mines: Sequence[str] | int | None) -> list[str]:
    """Return the names of the mines to draw among."""
    if not isinstance(split, str) or split not in SIZES:
        raise ValueError(f"split = {split!r}: valid choices are {', '.join(SIZES)}")
    count = SIZES[split] if mines is None else mines
    if isinstance(count, int | np.integer) and not isinstance(count, bool):
        if not 1 <= count <= SIZES[split]:
            raise ValueError(f"mines = {count}: {split} has 1 to {SIZES[split]}")
        return [mine_name(split, number) for number in range(int(count))]
    if not isinstance(count, str | list | tuple):
        raise ValueError(f"mines = {count!r:.80}: want a number of mines, or a list of names")
    names = [count] if isinstance(count, str) else list(count)
    other = [name for name in names if not isinstance(name, str) or parse_name(name)[0] != split]
    if other or not names or len(set(names)) < len(names):
        raise ValueError(
            f"mines = {names[:3]!r:.200}: want names of the split {split}, each once, for example {mine_name(split, 0)}"
        )
    return names
