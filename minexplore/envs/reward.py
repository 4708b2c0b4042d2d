"""The paper's reward: new cells, a penalty for a step without one, milestones, a penalty for touching rock."""

from __future__ import annotations

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
    gained = new > 0
    reward = np.where(gained, new * COVERAGE_GAIN / total, -IDLE_PENALTY)
    if gained.any():
        for share, bonus in MILESTONES:
            line = share * total
            reward += bonus * ((before < line) & (before + new >= line))
    return reward - COLLISION_PENALTY * collision
