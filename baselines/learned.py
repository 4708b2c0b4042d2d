"""A trained policy from its file of plain arrays: needs neither torch nor Ray."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError
from safetensors import SafetensorError, safe_open

from baselines import map_observation
from baselines.errors import BaselineError
from baselines.map_observation import MapObserver
from baselines.ppo.settings import Model
from minexplore.task import TaskParams

FORMAT = "minexplore-policy/1"
_ENCODER, _HEAD = "encoder.actor_encoder.", "pi.net.mlp.0."


class LearnedPolicy:
    """Gives the network's mean command; with `sample`, one drawn from its distribution, as in training."""

    def __init__(self, path: Path, robots: int, task: TaskParams, sample: bool = False) -> None:
        """Read the file.

        Raises
        ------
        BaselineError
            If there is no such file, it holds no policy, or one for other observations.
        """
        self.path, self._sample, self._task = path, sample, task
        self._arrays, about = _read(path)
        self.model = Model.model_validate_json(about["model"])
        self.observation = about["observation"]
        self._maps = MapObserver(robots, task) if self.observation == "map" else None
        self.builds_on = (map_observation,) if self._maps else ()
        size = task.beams + 3 + (self._maps.size if self._maps else 0)
        taken = self._first_layer().shape[1]
        if taken != size:
            raise BaselineError(f"{path}: takes {taken} numbers, an observation of this environment has {size}")
        self._hidden = np.zeros((2, robots, self.model.cell), np.float32)  # the LSTM's output and its cells
        self._rngs = [np.random.default_rng(i) for i in range(robots)]

    def _first_layer(self) -> np.ndarray:
        names = [f"{_ENCODER}net.mlp.0.weight", f"{_ENCODER}tokenizer.net.mlp.0.weight"]
        return next(self._arrays[name] for name in names if name in self._arrays)

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Begin new episodes."""
        self._hidden[:, robots] = 0.0
        if self._maps is not None:
            self._maps.forget(robots)
        for robot, seed in zip(robots.tolist(), seeds.tolist(), strict=True):
            self._rngs[robot] = np.random.default_rng([seed, 1])

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        features = observation
        if self._maps is not None:
            features = np.hstack([observation, self._maps.observe(observation, info["pose_m_rad"])])
        features = self._remember(features) if self.model.kind == "lstm" else self._layers(features, f"{_ENCODER}net.")
        head = features @ self._arrays[f"{_HEAD}weight"].T + self._arrays[f"{_HEAD}bias"]
        mean, log_spread = head[:, :2], self._arrays["pi.log_std"] if "pi.log_std" in self._arrays else head[:, 2:]
        if self._sample:
            spread = np.exp(np.clip(log_spread, -20.0, 20.0))
            mean = mean + spread * np.stack([rng.standard_normal(2) for rng in self._rngs])
        return np.clip(mean, -1.0, 1.0)

    def _layers(self, features: np.ndarray, room: str) -> np.ndarray:
        for layer in range(0, 2 * len(self.model.hidden), 2):
            weight, bias = (self._arrays[f"{room}mlp.{layer}.{part}"] for part in ("weight", "bias"))
            features = np.tanh(features @ weight.T + bias)
        return features

    def _remember(self, features: np.ndarray) -> np.ndarray:
        """Return the LSTM's output for what its tokenizer makes of observations, and keep its state."""
        arrays, tokens = self._arrays, self._layers(features, f"{_ENCODER}tokenizer.net.")
        output, cells = self._hidden
        gates = (
            tokens @ arrays[f"{_ENCODER}lstm.weight_ih_l0"].T + arrays[f"{_ENCODER}lstm.bias_ih_l0"]
            + output @ arrays[f"{_ENCODER}lstm.weight_hh_l0"].T + arrays[f"{_ENCODER}lstm.bias_hh_l0"]
        )  # fmt: skip
        entry, forget, new, out = np.split(gates, 4, axis=1)
        cells = _sigmoid(forget) * cells + _sigmoid(entry) * np.tanh(new)
        self._hidden = np.stack([_sigmoid(out) * np.tanh(cells), cells])
        return self._hidden[0]


def _read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    try:
        with safe_open(str(path), framework="numpy") as file:
            about, arrays = file.metadata() or {}, {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        if about.get("format") != FORMAT:
            raise BaselineError(f"{path}: format {about.get('format')!r}, this version reads {FORMAT!r}")
        Model.model_validate_json(about["model"])
        json.loads(about["reached"])
    except FileNotFoundError:
        raise BaselineError(f"{path}: no such file") from None
    except (SafetensorError, KeyError, ValueError, ValidationError, OSError) as error:
        raise BaselineError(f"{path}: not a policy's file ({error})") from error
    return arrays, about


def _sigmoid(x: np.ndarray) -> np.ndarray:
    return 0.5 * (1.0 + np.tanh(0.5 * x))
