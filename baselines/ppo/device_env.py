"""The environment on Warp as PPO samples it: scaled rewards; the figures of episodes that end stay on the device."""

from __future__ import annotations

import torch

from baselines.ppo.training_env import FIGURES
from minexplore.extra.warp.env import MineWarpEnv


class DeviceTrainingEnv:
    """Robots that are reset in the step that ends their episode; their first episodes end at random steps."""

    def __init__(self, env: MineWarpEnv, reward_scale: float, cell_bonus: float, fragment: int, seed: int) -> None:
        """Wrap an environment of autoreset mode SAME_STEP; `take_episodes` is called every `fragment` steps."""
        self.env, self._scale, self._bonus = env, reward_scale, cell_bonus
        observation, info = env.reset(seed=seed)
        self.device, count = observation.device, env.num_envs
        generator = torch.Generator(self.device).manual_seed(seed)
        steps = torch.randint(env.task.max_steps, (count,), generator=generator, device=self.device, dtype=torch.int32)
        env.tensors["steps"].copy_(steps)
        self._cells = info["cells_seen"].clone()
        self._return, self._steps = torch.zeros(count, device=self.device), torch.zeros(count, device=self.device)
        self._ended = torch.zeros((fragment, count), dtype=torch.bool, device=self.device)
        self._figures = torch.zeros((fragment, count, len(FIGURES)), device=self.device)
        self._row = 0
        self.observation = observation.clone()

    def step(self, actions: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Step all robots; return observations, scaled rewards with the bonus of new cells, and truncations."""
        observation, reward, _, truncated, info = self.env.step(actions)
        last = info["final_info"]
        gained = last["cells_seen"] - self._cells
        self._return += reward
        self._steps += 1
        figures = (last["coverage"], last["collisions"], self._return, self._steps)
        for k, values in enumerate(figures):
            self._figures[self._row, :, k] = values
        self._ended[self._row] = truncated
        self._row += 1
        going = ~truncated
        self._return *= going
        self._steps *= going
        self._cells.copy_(info["cells_seen"])
        return observation.clone(), reward * self._scale + gained * self._bonus, truncated.clone()

    def take_episodes(self) -> dict[str, list[float]]:
        """Return the figures of the episodes that ended since the last call; it waits for the device and checks it.

        Raises
        ------
        RuntimeError
            If anything went wrong on the device.
        """
        self.env.check()
        ended = self._figures[: self._row][self._ended[: self._row]].cpu().numpy()
        self._row = 0
        return {name: ended[:, k].tolist() for k, name in enumerate(FIGURES)}
