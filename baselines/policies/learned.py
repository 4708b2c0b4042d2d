"""A trained policy from its file of plain arrays; it needs neither torch nor Ray."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from safetensors import SafetensorError, safe_open

from baselines.base.errors import BaselineError
from baselines.policies.map_observation import MapObserver
from minexplore.sensing.observation import observation_space
from minexplore.task import TaskParams

FORMAT = "minexplore-policy/1"
_MOST_BYTES = 256_000_000  # of a checkpoint
_MOST_WIDTH = 8192  # of a layer
_Width = Annotated[int, Field(ge=1, le=_MOST_WIDTH)]
_TAKEN = -1  # numbers that the first layer takes: the observation's size
_ENCODER, _HEAD = "encoder.actor_encoder.", "pi.net.mlp.0."


class Model(BaseModel):
    """The layers of a policy's network; the value's network has the same ones."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    kind: Literal["mlp", "lstm"]
    hidden: list[_Width] = Field(min_length=1, max_length=16)
    cell: int = Field(ge=0, le=_MOST_WIDTH)
    sequence: int = Field(ge=0, le=_MOST_WIDTH)


class LearnedPolicy:
    """Returns the network's mean command; with `sample`, one drawn from its distribution, as in training."""

    def __init__(self, path: Path, count: int, task: TaskParams, sample: bool = False) -> None:
        """Read the file.

        Raises
        ------
        BaselineError
            If there is no such file, it holds no policy, or one for other observations.
        """
        self.path, self._sample = path, sample
        arrays, about = _read(path)
        self.model = Model.model_validate_json(about["model"])
        self.observation = about["observation"]
        _check_arrays(path, self.model, arrays)
        # In 64 bits the rounding of BLAS, which depends on the processor, stays below the 32 bits of a command.
        self._arrays = {name: array.astype(np.float64) for name, array in arrays.items()}
        self._maps = MapObserver(count, task) if self.observation == "map" else None
        size = observation_space(task).shape[0] + (self._maps.size if self._maps else 0)
        taken = self._first_layer().shape[1]
        if taken != size:
            raise BaselineError(f"{path}: takes {taken} numbers, an observation of this environment has {size}")
        self._state = np.zeros((2, count, self.model.cell))  # the LSTM's output and its cells
        self._rngs = [np.random.default_rng(i) for i in range(count)]

    def _first_layer(self) -> np.ndarray:
        names = [f"{_ENCODER}net.mlp.0.weight", f"{_ENCODER}tokenizer.net.mlp.0.weight"]
        return next(self._arrays[name] for name in names if name in self._arrays)

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Begin new episodes."""
        self._state[:, robots] = 0.0
        if self._maps is not None:
            self._maps.forget(robots)
        for robot, seed in zip(robots.tolist(), seeds.tolist(), strict=True):
            self._rngs[robot] = np.random.default_rng([seed, 1])

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        features = observation.astype(np.float64)
        if self._maps is not None:
            features = np.hstack([observation, self._maps.observe(observation, info)])
        features = self._recur(features) if self.model.kind == "lstm" else self._layers(features, f"{_ENCODER}net.")
        head = _linear(features, self._arrays[f"{_HEAD}weight"], self._arrays[f"{_HEAD}bias"])
        mean, log_sd = head[:, :2], self._arrays["pi.log_std"] if "pi.log_std" in self._arrays else head[:, 2:]
        if self._sample:
            sd = np.exp(np.clip(log_sd, -20.0, 20.0))
            mean = mean + sd * np.stack([rng.standard_normal(2) for rng in self._rngs])
        return np.clip(mean, -1.0, 1.0).astype(np.float32)

    def _layers(self, features: np.ndarray, prefix: str) -> np.ndarray:
        for layer in range(0, 2 * len(self.model.hidden), 2):
            weight, bias = (self._arrays[f"{prefix}mlp.{layer}.{part}"] for part in ("weight", "bias"))
            features = np.tanh(_linear(features, weight, bias))
        return features

    def _recur(self, features: np.ndarray) -> np.ndarray:
        """Return the LSTM's output (n, cell) for observations (n, features), and keep its state."""
        tokens = self._layers(features, f"{_ENCODER}tokenizer.net.")
        output, cells = self._state
        gates = sum(
            _linear(values, *(self._arrays[f"{_ENCODER}lstm.{part}_{kind}_l0"] for part in ("weight", "bias")))
            for values, kind in ((tokens, "ih"), (output, "hh"))
        )
        entry, forget, new, out = np.split(gates, 4, axis=1)
        cells = _sigmoid(forget) * cells + _sigmoid(entry) * np.tanh(new)
        self._state = np.stack([_sigmoid(out) * np.tanh(cells), cells])
        return self._state[0]


def _check_arrays(path: Path, model: Model, arrays: dict[str, np.ndarray]) -> None:
    """Refuse arrays that do not make the layers that a model names; how many numbers it takes is compared later."""
    shapes = _shapes(model, _TAKEN, 2 if "pi.log_std" in arrays else 4)
    for name, shape in shapes.items():
        found = arrays.get(name)
        if found is None:
            raise BaselineError(f"{path}: {name} is absent")
        if len(found.shape) != len(shape) or any(n not in (_TAKEN, m) for n, m in zip(shape, found.shape, strict=True)):
            raise BaselineError(f"{path}: {name} has shape {found.shape}, its model wants {shape}")
        if found.dtype.kind != "f" or not np.isfinite(found).all():
            raise BaselineError(f"{path}: {name}: want finite numbers")


def _shapes(model: Model, taken: int, outputs: int) -> dict[str, tuple[int, ...]]:
    """Return the shapes of a policy's arrays by name, for `taken` numbers in and `outputs` numbers out."""
    lstm = model.kind == "lstm"
    shapes: dict[str, tuple[int, ...]] = {}
    for layer, width in enumerate(model.hidden):
        prefix = f"{_ENCODER}{'tokenizer.' if lstm else ''}net.mlp.{2 * layer}."
        shapes |= {f"{prefix}weight": (width, taken), f"{prefix}bias": (width,)}
        taken = width
    if lstm:
        for kind, size in (("ih", taken), ("hh", model.cell)):
            shapes[f"{_ENCODER}lstm.weight_{kind}_l0"] = (4 * model.cell, size)
            shapes[f"{_ENCODER}lstm.bias_{kind}_l0"] = (4 * model.cell,)
        taken = model.cell
    shapes |= {f"{_HEAD}weight": (outputs, taken), f"{_HEAD}bias": (outputs,)}
    return shapes | ({"pi.log_std": (2,)} if outputs == 2 else {})


def trained_in(path: Path) -> str:
    """Return the id of the environment that a checkpoint was trained in.

    Raises
    ------
    BaselineError
        If it is no policy's file.
    """
    return _read(path)[1]["env"]


def _read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    try:
        if path.exists() and not path.is_file():
            raise BaselineError(f"{path}: not a plain file")
        if path.exists() and path.stat().st_size > _MOST_BYTES:
            raise BaselineError(f"{path}: {path.stat().st_size:,} bytes, a policy's file has at most {_MOST_BYTES:,}")
        with safe_open(str(path), framework="numpy") as file:
            about, arrays = file.metadata() or {}, {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        if about.get("format") != FORMAT:
            raise BaselineError(f"{path}: format {about.get('format')!r:.80}, this version reads {FORMAT!r}")
        Model.model_validate_json(about["model"])
        json.loads(about["reached"])
        if about["observation"] not in ("beams", "map") or not about["env"]:
            raise BaselineError(f"{path}: observation {about['observation']!r:.80}: want beams or map")
    except FileNotFoundError:
        raise BaselineError(f"{path}: no such file") from None
    except (SafetensorError, KeyError, ValueError, TypeError, ValidationError, OSError, RecursionError) as error:
        said = str(error)[:200].encode("unicode_escape").decode()
        raise BaselineError(f"{path}: not a policy's file ({said})") from error
    return arrays, about


def _linear(features: np.ndarray, weight: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """Return `features @ weight.T + bias`, a row at a time: BLAS rounds a product by its number of rows."""
    return np.matmul(weight, features[:, :, None])[:, :, 0] + bias


def _sigmoid(x: np.ndarray) -> np.ndarray:
    return 0.5 * (1.0 + np.tanh(0.5 * x))
