"""The network's own learning in torch: it imitates scores, then follows a policy gradient with a learned baseline."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from baselines.base.errors import BaselineError
from baselines.graph.network import Shape
from baselines.graph.scenes import Scenes
from baselines.graph.training.episodes import Decisions
from baselines.graph.training.settings import ImproveSettings, StartSettings
from baselines.graph.training.torch_network import GraphNetwork

_VALUE_WEIGHT = 0.5
_MOST_GRADIENT = 0.5


class Learner:
    """A network and its optimizer."""

    def __init__(self, shape: Shape, seed: int) -> None:
        """Begin with random weights."""
        torch.manual_seed(seed)
        torch.set_num_threads(1)
        self.network = GraphNetwork(shape)
        self._seed = seed
        self.optimizer = torch.optim.Adam(self.network.parameters())

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the network's weights as plain arrays."""
        return {name: value.detach().numpy().copy() for name, value in self.network.state_dict().items()}

    def imitate(self, scenes: Scenes, logits: np.ndarray, credit: np.ndarray, settings: StartSettings) -> float:
        """Let the scores follow logits (n, MOST), and the values credits (n,); return the divergence of the softmax."""
        tokens, apart, real = _tensors(scenes)
        aim = torch.from_numpy(logits).float().masked_fill(~real, -1e9).softmax(dim=1)
        wanted = torch.from_numpy(credit)
        optimizer = torch.optim.AdamW(self.network.parameters(), settings.lr)
        schedule = torch.optim.lr_scheduler.LinearLR(optimizer, 1.0, 0.0, settings.steps)
        for _ in range(settings.steps):
            some = torch.randint(len(aim), (settings.batch,))
            found, value = self.network(tokens[some], apart[some], real[some])
            loss = -(aim[some] * found.log_softmax(dim=1)).sum(dim=1).mean()
            loss = loss + _VALUE_WEIGHT * (value - wanted[some]).pow(2).mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
        self.optimizer = torch.optim.Adam(self.network.parameters())
        with torch.no_grad():
            found = self.network(tokens, apart, real)[0].log_softmax(dim=1)
            return float((aim * (aim.clamp(min=1e-12).log() - found)).sum(dim=1).mean())

    def improve(self, decisions: Decisions, settings: ImproveSettings, update: int) -> dict[str, float]:
        """Take PPO's clipped steps (Schulman et al. 2017) on decisions; return figures of the step.

        The advantage of a decision is its credit less the network's value of the scene. The learning rate falls with
        the number of the update; draws depend on it and on the seed only.
        """
        torch.manual_seed(self._seed + update)
        for group in self.optimizer.param_groups:
            group["lr"] = settings.lr * 0.5 ** (update / settings.half_life)
        tokens, apart, real = _tensors(decisions.scenes)
        chosen, before = torch.from_numpy(decisions.chosen), torch.from_numpy(decisions.log_chance)
        credit = torch.from_numpy(decisions.credit)
        with torch.no_grad():
            above = credit - self.network(tokens, apart, real)[1]
        explained = 1.0 - float(above.var() / credit.var().clamp(min=1e-9))
        above = (above - above.mean()) / above.std().clamp(min=1e-6)
        for _ in range(settings.epochs):
            for some in torch.randperm(len(chosen)).split(settings.batch):
                found, value = self.network(tokens[some], apart[some], real[some])
                log_chances = found.log_softmax(dim=1)
                ratio = (_of(log_chances, chosen[some]) - before[some]).exp()
                clipped = ratio.clamp(1 - settings.clip, 1 + settings.clip)
                loss = -torch.minimum(ratio * above[some], clipped * above[some]).mean()
                loss = loss - settings.entropy * _entropy(log_chances)
                loss = loss + _VALUE_WEIGHT * (value - credit[some]).pow(2).mean()
                self.optimizer.zero_grad()
                loss.backward()
                torch.nn.utils.clip_grad_norm_(self.network.parameters(), _MOST_GRADIENT)
                self.optimizer.step()
        with torch.no_grad():
            log_chances = self.network(tokens, apart, real)[0].log_softmax(dim=1)
        moved, entropy = float((before - _of(log_chances, chosen)).mean()), float(_entropy(log_chances))
        figures = {"explained": explained, "entropy": entropy, "divergence": moved}
        return {"decisions": len(chosen), **{name: round(value, 4) for name, value in figures.items()}}

    def save(self, path: Path) -> None:
        """Write weights and the optimizer's state beside the file's place, then move them there."""
        named = dict(self.network.named_parameters())
        held = {f"weight:{name}": value.detach() for name, value in named.items()}
        for name, value in named.items():
            for kind, number in self.optimizer.state.get(value, {}).items():
                held[f"{kind}:{name}"] = torch.as_tensor(number)
        part = path.with_suffix(".part")
        save_file({name: value.contiguous() for name, value in held.items()}, str(part))
        part.rename(path)

    def load(self, path: Path) -> None:
        """Take weights and the optimizer's state from a file of `save`.

        Raises
        ------
        BaselineError
            If it is no such file, or one of another network.
        """
        try:
            with safe_open(str(path), framework="pt") as file:
                held = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            named = dict(self.network.named_parameters())
            with torch.no_grad():
                for name, value in named.items():
                    value.copy_(held[f"weight:{name}"])
            kinds = ("step", "exp_avg", "exp_avg_sq")
            if f"step:{next(iter(named))}" in held:
                for name, value in named.items():
                    self.optimizer.state[value] = {kind: held[f"{kind}:{name}"] for kind in kinds}
        except (SafetensorError, OSError, KeyError, RuntimeError) as error:
            raise BaselineError(f"{path}: not the state of this run ({error}); remove it") from error


def _tensors(scenes: Scenes) -> tuple[Tensor, Tensor, Tensor]:
    return torch.from_numpy(scenes.tokens), torch.from_numpy(scenes.apart_m), torch.from_numpy(scenes.real)


def _of(log_chances: Tensor, chosen: Tensor) -> Tensor:
    return log_chances.gather(1, chosen[:, None])[:, 0]


def _entropy(log_chances: Tensor) -> Tensor:
    return -(log_chances.exp() * log_chances.clamp(min=-50)).sum(dim=1).mean()
