"""The outcome of a step of many robots, and the part of it that belongs to one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass
class StepOutcome:
    """The outcome of a step: observations (k, beams + 3) float32, rewards (k,), truncations (k,), and the info."""

    observation: np.ndarray
    reward: np.ndarray
    truncated: np.ndarray
    info: dict[str, np.ndarray]


def info_of_robot(info: dict[str, np.ndarray], row: int) -> dict[str, Any]:
    """Return one robot's info: arrays with the same dtypes, a number being one without dimensions."""
    return {name: value[row, ...].copy() for name, value in info.items()}
