"""The vector environment that PPO trains in: scaled rewards, figures at an episode's end only, an optional map."""

from __future__ import annotations

from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium.vector import VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space

from baselines.base.environments import built_ids, make_env, require_trainable
from baselines.base.errors import BaselineError
from baselines.policies.map_observation import MapObserver
from baselines.ppo.mine_group import MineGroup
from minexplore import FAMILY
from minexplore.envs.vector import MineVectorEnv

FIGURES = ("coverage", "collisions", "return", "steps")


class TrainingEnv(VectorWrapper):
    """Adds an episode's unscaled `FIGURES` to the info of its last step.

    Rewards are the paper's, scaled, plus a bonus for every new cell if the settings have one. The first episodes end
    at random steps, so that the robots' episodes do not all end in one iteration.
    """

    def __init__(self, env: VectorEnv, observation: str, reward_scale: float, cell_bonus: float, seed: int) -> None:
        """Wrap a `MineVectorEnv` or a `MineGroup`."""
        super().__init__(env)
        self._mine = cast(MineVectorEnv | MineGroup, env.unwrapped)
        self._scale, self._bonus, self._rng = reward_scale, cell_bonus, np.random.default_rng(seed)
        self._maps = MapObserver(self.num_envs, self._mine.task) if observation == "map" else None
        if self._maps is not None:
            plain, size = self._mine.single_observation_space, self._maps.size
            assert isinstance(plain, gymnasium.spaces.Box)
            low = np.concatenate([plain.low, np.zeros(size, np.float32)])
            high = np.concatenate([plain.high, np.ones(size, np.float32)])
            self.single_observation_space = gymnasium.spaces.Box(low, high, dtype=np.float32)
            self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._return, self._steps, self._cells = (np.zeros(self.num_envs) for _ in range(3))
        self._over = np.zeros(self.num_envs, dtype=bool)

    def reset(self, **kwargs: Any) -> tuple[np.ndarray, dict[str, Any]]:  # type: ignore[override]
        """Reset all robots."""
        observation, info = self.env.reset(**kwargs)
        done = self._rng.integers(self._mine.task.max_steps, size=self.num_envs)
        for mine in self._mine.mines if isinstance(self._mine, MineGroup) else [self._mine]:
            mine.robots.steps[:], done = done[: mine.num_envs], done[mine.num_envs :]
        self._return[:], self._steps[:], self._over[:] = 0.0, 0, False
        self._cells = info["cells_seen"].copy()
        return self._with_map(observation, np.arange(self.num_envs), info), {}

    def step(  # type: ignore[override]
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Step all robots."""
        observation, reward, terminated, truncated, info = self.env.step(actions)
        self._return = np.where(self._over, 0.0, self._return + reward)
        self._steps = np.where(self._over, 0, self._steps + 1)
        new = np.where(self._over, 0, info["cells_seen"] - self._cells)
        self._cells = info["cells_seen"].copy()
        observation = self._with_map(observation, np.flatnonzero(self._over), info)
        self._over = truncated.copy()
        last: dict[str, Any] = {}
        if truncated.any():
            figures = (info["coverage"], info["collisions"], self._return, self._steps)
            for name, values in zip(FIGURES, figures, strict=True):
                last[name], last[f"_{name}"] = values.astype(float), truncated
        return observation, reward * self._scale + new * self._bonus, terminated, truncated, last

    def _with_map(self, observation: np.ndarray, started: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        if self._maps is None:
            return observation
        self._maps.forget(started)
        return np.hstack([observation, self._maps.observe(observation, info)])


def training_mines(env: str, mines: int) -> list[str]:
    """Return the ids of the mines to train in: of `MineXplore/Family-v0` the first mines of the training split.

    Raises
    ------
    BaselineError
        If the id is unknown, a mine is not built, or one that policies are judged by.
    """
    ids = built_ids("train", mines) if env == FAMILY else [env]
    for env_id in ids:
        require_trainable(env_id)
    return ids


def make_training_env(context: dict[str, Any]) -> TrainingEnv:
    """Make the environment that a Ray runner samples in; `context` is what `env_config` holds, and `num_envs`.

    Raises
    ------
    BaselineError
        As `training_mines`, or if a world cannot be loaded, or the robots cannot be spread evenly over the mines.
    """
    robots = context.get("num_envs", 1)
    ids = training_mines(context["env"], context["mines"])[:robots]  # of one robot RLlib asks the spaces only
    if robots % len(ids):
        raise BaselineError(f"robots = {robots}, mines = {len(ids)}: want as many robots in each mine")
    mines = [make_env(env_id, robots // len(ids)) for env_id in ids]
    env = MineGroup(mines) if context["env"] == FAMILY else mines[0]
    return TrainingEnv(env, context["observation"], context["reward_scale"], context["cell_bonus"], context["seed"])
