"""Where an episode ends in time: by the id that `gymnasium.make` was given, or by the task of what is made directly."""

from __future__ import annotations

from dataclasses import replace

import gymnasium
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import VectorEnv

from minexplore.task import LONG, TaskParams, coerce_params


class Timed:
    """An environment whose `spec.max_episode_steps` is where its episodes end; without a spec `task.max_steps` is."""

    task: TaskParams
    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """Return what `gymnasium.make` or `make_vec` made the environment of, or None."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = spec
        if spec is None:
            return
        steps = getattr(gymnasium.registry.get(spec.id), "max_episode_steps", None)
        asked = coerce_params(TaskParams, spec.kwargs.get("task")).max_steps
        if steps is not None and asked not in (steps, TaskParams.max_steps):
            raise ValueError(
                f"task: max_steps = {asked}: {spec.id} ends after max_episode_steps = {steps}; "
                f"want max_episode_steps={asked} instead"
            )
        if steps is None or isinstance(self, VectorEnv):
            spec.max_episode_steps = self.task.max_steps
        else:  # Gymnasium's `TimeLimit` counts the steps
            self._set_task(replace(self.task, max_steps=LONG))

    def _set_task(self, task: TaskParams) -> None:
        self.task = task
