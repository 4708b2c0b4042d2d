"""The outcome of a step, and the paper's reward.

The reward counts new cells, a penalty for a step without one, milestones, and a penalty for touching rock.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

MILESTONES = ((0.25, 15.0), (0.50, 30.0), (0.75, 45.0))
COVERAGE_GAIN, IDLE_PENALTY, COLLISION_PENALTY = 10.0, 0.002, 15.0
CAP = COVERAGE_GAIN + sum(bonus for _, bonus in MILESTONES)


def step_reward(before: np.ndarray, new: np.ndarray, total: int, collision: np.ndarray) -> np.ndarray:
    """Return r = new * 10 / total - [new = 0] * 0.002 + milestones passed - [collision] * 15, one a robot.

    Parameters
    ----------
    before, new : (n,) int
        Cells seen before the step, and seen in it for the first time.
    total : int
        Reachable cells. An episode that sees them all and touches nothing returns at most `CAP`.
    collision : (n,) bool
    """
    penalty = COLLISION_PENALTY * collision
    if not np.count_nonzero(new):
        return -IDLE_PENALTY - penalty
    reward = np.where(new > 0, new * COVERAGE_GAIN / total, -IDLE_PENALTY)
    after = before + new
    for share, bonus in MILESTONES:
        passed = (before < share * total) & (after >= share * total)
        if passed.any():
            reward += bonus * passed
    return reward - penalty


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
