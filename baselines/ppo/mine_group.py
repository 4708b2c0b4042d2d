"""Robots in several mines side by side, as one vector environment: what PPO trains in on the generated family."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from gymnasium.vector.utils import batch_space

from minexplore.envs.vector import MineVectorEnv


class MineGroup(VectorEnv):
    """The robots of several mines with one task: those of the first mine first. A robot stays in its mine."""

    def __init__(self, mines: list[MineVectorEnv]) -> None:
        """Take the mines' environments."""
        first = mines[0]
        self.mines, self.task, self.metadata = mines, first.task, first.metadata
        self.num_envs = sum(mine.num_envs for mine in mines)
        self.single_observation_space, self.single_action_space = (
            first.single_observation_space,
            first.single_action_space,
        )
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._ends = np.cumsum([mine.num_envs for mine in mines])[:-1]

    def reset(  # type: ignore[override]
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Reset all robots; robot i begins with the seed `seed + i`."""
        starts = [0, *self._ends.tolist()]
        seeds = [None if seed is None else seed + start for start in starts]
        parts = [mine.reset(seed=own, options=options) for mine, own in zip(self.mines, seeds, strict=True)]
        return np.concatenate([part[0] for part in parts]), _join([part[1] for part in parts])

    def step(  # type: ignore[override]
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Step all robots."""
        parts = [mine.step(own) for mine, own in zip(self.mines, np.split(actions, self._ends), strict=True)]
        observation, reward, terminated, truncated = (np.concatenate([part[k] for part in parts]) for k in range(4))
        return observation, reward, terminated, truncated, _join([part[4] for part in parts])

    def close_extras(self, **kwargs: Any) -> None:
        """Close the mines' environments."""
        for mine in self.mines:
            mine.close()


def _join(infos: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the arrays of several mines' infos, robot after robot."""
    return {name: np.concatenate([info[name] for info in infos]) for name in infos[0]}
