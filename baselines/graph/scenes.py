"""Scenes of many decisions as arrays, as the network in torch takes them."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from baselines.graph.features import MOST, NAMES, Scene


@dataclass(frozen=True)
class Scenes:
    """Scenes, each filled up to `MOST` clusters.

    Attributes
    ----------
    tokens : (n, MOST, len(NAMES)) float32
    apart_m : (n, MOST, MOST) float32
    real : (n, MOST) bool
        False for what is filled in.
    """

    tokens: np.ndarray
    apart_m: np.ndarray
    real: np.ndarray


def stack_scenes(scenes: list[Scene]) -> Scenes:
    """Return scenes as arrays."""
    tokens = np.zeros((len(scenes), MOST, len(NAMES)), np.float32)
    apart, real = np.zeros((len(scenes), MOST, MOST), np.float32), np.zeros((len(scenes), MOST), dtype=bool)
    for i, scene in enumerate(scenes):
        count = len(scene.clusters)
        tokens[i, :count], apart[i, :count, :count], real[i, :count] = scene.tokens, scene.apart_m, True
    return Scenes(tokens, apart, real)


def join_scenes(parts: list[Scenes]) -> Scenes:
    """Return the scenes of several mines as one."""
    return Scenes(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Scenes)))
