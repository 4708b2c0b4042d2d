"""The vector environment as Stable-Baselines3 takes it (the extra `sb3`)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv

import minexplore
from minexplore.tasks.exploration import info_of_robot

Indices = None | int | Iterable[int]


class MineVecEnv(VecEnv):
    """`MineVectorEnv` under the interface of Stable-Baselines3's `VecEnv`.

    All robots step in one call. A robot whose episode ends is reset in the same step; its info then has
    `terminal_observation` and `TimeLimit.truncated`, and the info of its first look is in `reset_infos`.

    Parameters
    ----------
    env_id : str
        As `gymnasium.make_vec` takes it, also with `minexplore:` before it.
    num_envs : int
    **kwargs
        Other arguments of `gymnasium.make_vec`: world, task, robot, render_mode, camera, threads, max_episode_steps.

    Notes
    -----
    All robots share one environment: `get_attr` gives its attribute once a robot, `set_attr` and `env_method` need all
    robots and act once.

    Raises
    ------
    ValueError
        If this package has no environment of that id.
    """

    def __init__(self, env_id: str, num_envs: int, **kwargs: Any) -> None:
        """Make the environment."""
        kwargs["autoreset_mode"] = AutoresetMode.SAME_STEP
        try:
            self.env: Any = gymnasium.make_vec(env_id, num_envs, "vector_entry_point", **kwargs)
        except (gymnasium.error.UnregisteredEnv, ModuleNotFoundError) as error:
            known = [*minexplore.environments(), minexplore.FAMILY]
            raise ValueError(f"env_id = {env_id!r}: valid choices are {', '.join(known)}") from error
        self._actions = np.zeros(0)
        super().__init__(num_envs, self.env.single_observation_space, self.env.single_action_space)

    def reset(self) -> np.ndarray:
        """Reset all robots, by the seeds of `seed` where they were set since the last reset."""
        observation, info = self.env.reset(seed=self._seeds, options=self._options_of_all())
        self.reset_infos = self._infos_of(info, np.arange(self.num_envs))
        self._reset_seeds()
        self._reset_options()
        return observation

    def _options_of_all(self) -> dict[str, Any] | None:
        """Return what `set_options` was given; the robots share one environment, so all must have the same."""
        first = self._options[0]
        if any(repr(one) != repr(first) for one in self._options):
            raise ValueError("set_options: the robots share one environment; want the same options for all")
        return first or None

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions (n, commands) of the next step."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all robots."""
        observation, reward, terminated, truncated, info = self.env.step(self._actions)
        over = terminated | truncated
        infos = self._infos_of(info, np.arange(self.num_envs))
        ended = np.flatnonzero(over)
        if len(ended):
            for i, last in zip(ended.tolist(), self._infos_of(info["final_info"], ended), strict=True):
                self.reset_infos[i] = infos[i]
                infos[i] = {**last, "terminal_observation": info["final_obs"][i]}
        for i in range(self.num_envs):
            infos[i]["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
        return observation, reward.astype(np.float32), over, infos

    def _infos_of(self, info: dict[str, Any], robots: np.ndarray) -> list[dict[str, Any]]:
        plain = {k: v for k, v in info.items() if not k.startswith(("_", "final"))}
        return [info_of_robot(plain, i) for i in robots.tolist()]

    def close(self) -> None:
        """Free renderer and threads."""
        self.env.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Return one picture (480, 640, 3) uint8 a robot in render mode `rgb_array`, else None for each."""
        return self.env.render() or [None] * self.num_envs

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Return the environment's attribute once for each of the robots."""
        return [getattr(self.env, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Set an attribute of the environment that all robots share."""
        self._require_all("set_attr", attr_name, indices)
        setattr(self.env, attr_name, value)

    def env_method(self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any) -> list:
        """Call a method of the environment once, and return its result once for each robot."""
        self._require_all("env_method", method_name, indices)
        return [getattr(self.env, method_name)(*method_args, **method_kwargs)] * self.num_envs

    def env_is_wrapped(self, wrapper_class: type[gymnasium.Wrapper], indices: Indices = None) -> list[bool]:
        """Return False for each of the robots: no Gymnasium wrapper is round one of them."""
        return [False for _ in self._get_indices(indices)]

    def _require_all(self, call: str, name: str, indices: Indices) -> None:
        if len(set(self._get_indices(indices))) != self.num_envs:
            raise ValueError(f"{call}({name!r}, indices={indices}): the robots share one environment; want all of them")
