"""The network in NumPy: attention over the clusters of a scene, with a bias by the path lengths between them."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from baselines.graph.features import FLOOR, NAMES, STUBS

APART_M = 20.0  # path lengths are divided by
FARTHEST = 5.0  # and cut at


class Shape(BaseModel):
    """The layers of a network; without `stubs` and `floor` it gets no figures of dead ends and of floor speeds."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    width: Annotated[int, Field(ge=1, le=1024)]
    heads: Annotated[int, Field(ge=1, le=64)]
    blocks: Annotated[int, Field(ge=0, le=16)]
    attention: bool
    stubs: bool
    floor: bool


def array_shapes(shape: Shape) -> dict[str, tuple[int, ...]]:
    """Return the shapes of a network's arrays by name."""
    w = shape.width
    shapes: dict[str, tuple[int, ...]] = {"enter.weight": (w, len(NAMES)), "enter.bias": (w,)}
    for block in range(shape.blocks):
        at = f"blocks.{block}."
        for name, out, taken in (("first", 2 * w, w), ("second", w, 2 * w)):
            shapes |= {f"{at}{name}.weight": (out, taken), f"{at}{name}.bias": (out,)}
        shapes |= {f"{at}norm.weight": (w,), f"{at}norm.bias": (w,)}
        if shape.attention:
            shapes |= {f"{at}mix_norm.weight": (w,), f"{at}mix_norm.bias": (w,), f"{at}near": (shape.heads,)}
            shapes |= {f"{at}mix.weight": (3 * w, w), f"{at}mix.bias": (3 * w,)}
            shapes |= {f"{at}merge.weight": (w, w), f"{at}merge.bias": (w,)}
    return shapes | {"score.weight": (2, w), "score.bias": (2,)}


def scores(arrays: dict[str, np.ndarray], shape: Shape, tokens: np.ndarray, apart_m: np.ndarray) -> np.ndarray:
    """Return the score (k,) of each cluster of a scene: the greatest one is driven to."""
    apart = np.minimum(apart_m / APART_M, FARTHEST)
    x = _linear(arrays, "enter", told(shape, tokens))
    for block in range(shape.blocks):
        at = f"blocks.{block}."
        if shape.attention:
            x = x + _attend(arrays, at, shape.heads, _norm(arrays, f"{at}mix_norm", x), apart)
        hidden = np.maximum(_linear(arrays, f"{at}first", _norm(arrays, f"{at}norm", x)), 0.0)
        x = x + _linear(arrays, f"{at}second", hidden)
    return _linear(arrays, "score", x)[:, 0]


def unused(shape: Shape) -> list[slice]:
    """Return the features that a network is not told."""
    return [part for part, is_told in ((STUBS, shape.stubs), (FLOOR, shape.floor)) if not is_told]


def told(shape: Shape, tokens: np.ndarray) -> np.ndarray:
    """Return tokens (..., len(NAMES)) float64 with zeros for what a network is not told."""
    held = tokens.astype(np.float64)
    for part in unused(shape):
        held[..., part] = 0.0
    return held


def _attend(arrays: dict[str, np.ndarray], at: str, heads: int, x: np.ndarray, apart: np.ndarray) -> np.ndarray:
    count, width = x.shape
    q, k, v = _linear(arrays, f"{at}mix", x).reshape(count, 3, heads, width // heads).transpose(1, 2, 0, 3)
    weights = q @ k.transpose(0, 2, 1) / np.sqrt(width // heads) - arrays[f"{at}near"][:, None, None] * apart
    weights = np.exp(weights - weights.max(axis=2, keepdims=True))
    mixed = (weights / weights.sum(axis=2, keepdims=True)) @ v
    return _linear(arrays, f"{at}merge", mixed.transpose(1, 0, 2).reshape(count, width))


def _linear(arrays: dict[str, np.ndarray], name: str, x: np.ndarray) -> np.ndarray:
    return x @ arrays[f"{name}.weight"].T + arrays[f"{name}.bias"]


def _norm(arrays: dict[str, np.ndarray], name: str, x: np.ndarray) -> np.ndarray:
    x = x - x.mean(axis=1, keepdims=True)
    return x / np.sqrt((x**2).mean(axis=1, keepdims=True) + 1e-5) * arrays[f"{name}.weight"] + arrays[f"{name}.bias"]
