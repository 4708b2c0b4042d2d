"""The paper's reward: new cells, a price for standing still, milestones once each, a penalty for touching rock."""

from __future__ import annotations

from dataclasses import dataclass, field

MILESTONES = ((0.25, 15.0), (0.50, 30.0), (0.75, 45.0))
COVERAGE_GAIN, IDLE_PENALTY, COLLISION_PENALTY = 10.0, 0.002, 15.0
CAP = COVERAGE_GAIN + sum(bonus for _, bonus in MILESTONES)


@dataclass
class Reward:
    """r = new * 10 / total - [new = 0] * 0.002 + milestones - [collision] * 15; an episode returns at most `CAP`."""

    total_cells: int
    seen_cells: int = 0
    passed: int = field(default=0, init=False)

    def step(self, new_cells: int, collision: bool) -> float:
        """Return the reward of one control step that saw `new_cells` cells for the first time."""
        self.seen_cells += new_cells
        reward = new_cells * COVERAGE_GAIN / self.total_cells if new_cells else -IDLE_PENALTY
        while self.passed < len(MILESTONES) and self.seen_cells >= MILESTONES[self.passed][0] * self.total_cells:
            reward += MILESTONES[self.passed][1]
            self.passed += 1
        return reward - COLLISION_PENALTY * collision
