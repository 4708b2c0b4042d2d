"""PPO on the environment's device, by rsl-rl: the same settings, results and checkpoints as RLlib's run gives."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import torch
from rsl_rl.algorithms import PPO
from rsl_rl.models import MLPModel
from rsl_rl.storage import RolloutStorage
from tensordict import TensorDict

from baselines.base.environments import find_id
from baselines.base.errors import BaselineError
from baselines.ppo.device_env import DeviceTrainingEnv
from baselines.ppo.history import POLICY
from baselines.ppo.settings import TrainSettings
from minexplore.backends import make_vector_env

_FILE = "state.pt"
_ENCODER, _HEAD = "encoder.actor_encoder.net.mlp", "pi.net.mlp.0"  # names of RLlib's checkpoints
_SET = {"actor": ["beams"], "critic": ["beams"]}


class DeviceAlgorithm:
    """What `baselines.ppo.train` needs of an algorithm."""

    def __init__(self, settings: TrainSettings, steps_done: int, device: str) -> None:
        """Make environment, networks and storage; `steps_done` is added to the seed, as on the CPU.

        Raises
        ------
        BaselineError
            If the settings ask for what the device does not have: a map, or an LSTM.
        """
        if settings.observation != "beams" or settings.model.kind != "mlp":
            raise BaselineError(
                f"observation = {settings.observation}, model = {settings.model.kind}: on a device want beams and mlp"
            )
        self.settings, self.training_iteration, seed = settings, 0, settings.seed + steps_done
        torch.manual_seed(seed)
        ppo = settings.ppo
        kwargs = gymnasium.spec(find_id(settings.env)).kwargs
        env: Any = make_vector_env(settings.robots, "warp", device=device, autoreset_mode="SAME_STEP", **kwargs)
        self.env = DeviceTrainingEnv(env, ppo.reward_scale, ppo.cell_bonus, ppo.fragment, seed)
        self._observed = self._group(self.env.observation)
        layers = {"hidden_dims": settings.model.hidden, "activation": "tanh"}
        noise = {"class_name": "GaussianDistribution", "std_type": "log"}
        actor = MLPModel(self._observed, _SET, "actor", 2, distribution_cfg=noise, **layers)
        critic = MLPModel(self._observed, _SET, "critic", 1, **layers)
        where = str(self.env.device)
        self.ppo = PPO(
            actor,
            critic,
            RolloutStorage("rl", settings.robots, ppo.fragment, self._observed, [2], where),
            num_learning_epochs=ppo.epochs,
            num_mini_batches=max(1, settings.robots * ppo.fragment // ppo.minibatch),
            clip_param=ppo.clip,
            gamma=ppo.gamma,
            lam=ppo.lambda_,
            value_loss_coef=ppo.value,
            entropy_coef=ppo.entropy,
            learning_rate=ppo.lr,
            max_grad_norm=ppo.grad_clip,
            use_clipped_value_loss=False,
            schedule="fixed",
            device=where,
        )
        self.ppo.train_mode()

    def _group(self, observation: torch.Tensor) -> TensorDict:
        return TensorDict({"beams": observation}, batch_size=[self.settings.robots], device=observation.device)

    def train(self) -> dict[str, Any]:
        """Sample a fragment of every robot and learn from it; return the part of RLlib's result that is used."""
        self._set_rate()
        with torch.inference_mode():
            for _ in range(self.settings.ppo.fragment):
                observation, reward, truncated = self.env.step(self.ppo.act(self._observed))
                self._observed = self._group(observation)
                self.ppo.process_env_step(self._observed, reward, truncated, {"time_outs": truncated})
            self.ppo.compute_returns(self._observed)
            values, returns = self.ppo.storage.values, self.ppo.storage.returns
            explained = float(1 - (returns - values).var() / returns.var().clamp(min=1e-12))
        losses = self.ppo.update()
        self.training_iteration += 1
        return {
            "env_runners": {
                "num_env_steps_sampled": self.settings.robots * self.settings.ppo.fragment,
                "episodes": self.env.take_episodes(),
            },
            "learners": {POLICY: {"entropy": losses["entropy"], "vf_explained_var": explained}},
        }

    def _set_rate(self) -> None:
        """Lower the learning rate linearly to `lr_end`, where the settings have one."""
        ppo = self.settings.ppo
        if ppo.lr_end is None:
            return
        done = self.training_iteration * self.settings.robots * ppo.fragment / self.settings.steps
        for group in self.ppo.optimizer.param_groups:
            group["lr"] = ppo.lr + min(1.0, done) * (ppo.lr_end - ppo.lr)

    def get_module(self, name: str) -> Any:
        """Return an object whose `state_dict` has the policy's arrays by RLlib's names."""
        return _Renamed(self.ppo.get_policy().state_dict(), len(self.settings.model.hidden))

    def save_to_path(self, folder: str) -> None:
        """Write networks, optimizer and iteration into a new folder."""
        Path(folder).mkdir(parents=True)
        torch.save({**self.ppo.save(), "iteration": self.training_iteration}, Path(folder) / _FILE)

    def restore_from_path(self, folder: str) -> None:
        """Take up what `save_to_path` wrote."""
        # Adam counts its steps on the CPU: on the device, every update would wait for them.
        state = torch.load(Path(folder) / _FILE, weights_only=True, map_location="cpu")
        self.training_iteration = state.pop("iteration")
        self.ppo.load(state, None, True)

    def stop(self) -> None:
        """Free the environment."""
        self.env.env.close()


class _Renamed:
    """The actor's arrays by the names that a checkpoint of `baselines.policies.learned` has."""

    def __init__(self, arrays: dict[str, torch.Tensor], hidden: int) -> None:
        names = {
            f"mlp.{2 * k}.{part}": f"{_ENCODER}.{2 * k}.{part}" for k in range(hidden) for part in ("weight", "bias")
        }
        names |= {f"mlp.{2 * hidden}.{part}": f"{_HEAD}.{part}" for part in ("weight", "bias")}
        names["distribution.log_std_param"] = "pi.log_std"
        self._arrays = {ours: arrays[theirs] for theirs, ours in names.items()}

    def state_dict(self) -> dict[str, torch.Tensor]:
        return self._arrays
