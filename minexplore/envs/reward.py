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
