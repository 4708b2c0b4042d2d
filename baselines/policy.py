"""What a policy is, and the classical ones by name."""

from __future__ import annotations

import hashlib
import inspect
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from baselines.errors import BaselineError
from minexplore.task import TaskParams

CLASSICAL = ("random", "reactive", "wall-following", "nearest-frontier", "information-gain")


class Policy(Protocol):
    """Drives n robots, each alone in its own copy of a mine, by their local observations and true poses."""

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Begin new episodes of robots (k,); what they draw at random comes from their seeds (k,)."""

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2) in [-1, 1] from observations (n, beams + 3) and infos, of which poses may be used."""


def make_policy(name: str, robots: int, task: TaskParams) -> Policy:
    """Return a policy by its name, or the one that a checkpoint holds.

    Raises
    ------
    BaselineError
        If there is none of that name; the message lists those that there are.
    """
    from baselines.frontier import InformationGain, NearestFrontier
    from baselines.learned import LearnedPolicy
    from baselines.random_walk import RandomWalk
    from baselines.reactive import Reactive
    from baselines.wall_following import WallFollowing

    kinds: tuple[Any, ...] = (RandomWalk, Reactive, WallFollowing, NearestFrontier, InformationGain)
    if name in CLASSICAL:
        return dict(zip(CLASSICAL, kinds, strict=True))[name](robots, task)
    if name.endswith(".safetensors"):
        return LearnedPolicy(Path(name), robots, task)
    raise BaselineError(f"policy = {name!r}: valid choices are {', '.join(CLASSICAL)}, or a file NAME.safetensors")


def policy_sha256(policy: Policy) -> str:
    """Return the hash of what a policy does: of its name, its source and what that builds on, its weights."""
    checkpoint = getattr(policy, "path", None)
    rooms = {inspect.getfile(kind) for kind in type(policy).__mro__ if kind.__module__.startswith("baselines.")}
    rooms |= {inspect.getfile(module) for module in getattr(policy, "builds_on", ())}
    learned = [Path(checkpoint).read_bytes()] if checkpoint is not None else []
    parts = [type(policy).__qualname__.encode(), *learned, *(Path(file).read_bytes() for file in sorted(rooms))]
    return hashlib.sha256(b"".join(parts)).hexdigest()


def ranges_m(observation: np.ndarray, task: TaskParams) -> np.ndarray:
    """Return the beams' ranges (n, beams), m, of observations."""
    near, far = task.range_m
    return near + observation[:, : task.beams].astype(float) * (far - near)
