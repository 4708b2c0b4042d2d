"""What a task is; and exploration, whose reward counts new cells, milestones and touching rock, as the paper's does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from minexplore.tasks.starts import EpisodeStart

STARTS = ("pose", "cell", "station", "noise_seed")  # options of a reset, see `minexplore.tasks.starts`
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
    """The outcome of a step: observations (k, features) float32, rewards, ends of both kinds (k,), and the info."""

    observation: np.ndarray
    reward: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    info: dict[str, np.ndarray]


def info_of_robot(info: dict[str, np.ndarray], row: int) -> dict[str, Any]:
    """Return one robot's info: arrays with the same dtypes, a number being one without dimensions."""
    return {name: value[row, ...].copy() for name, value in info.items()}


class Exploration:
    """See as many cells as possible: a task, which decides where episodes begin and end, the reward, and what is known.

    Its robots are the rows of a batch. Another task replaces methods.
    """

    OPTIONS: tuple[str, ...] = STARTS  # of a reset
    CHANGES: tuple[str, ...] = ()  # arrays that change while robots drive, beside those of the batch

    def __init__(self, batch: Any) -> None:
        """Take a `RobotBatch`."""
        self.batch = batch

    def start_of(self, options: Mapping[str, Any] | None) -> EpisodeStart | None:
        """Return what known options of a reset fix; a `ValueError` refuses what is impossible."""
        if not options:
            return None
        from minexplore.tasks.starts import start_of

        return start_of(options, self.batch.world, self.batch.robot.radius_m)

    def place(self, robot: int, rng: np.random.Generator, start: EpisodeStart | None) -> list[float] | None:
        """Draw an episode; return where it begins (2 or 3,) m, mine frame, or None for near the entrance."""
        return None

    def begin(self, robots: np.ndarray) -> None:
        """Begin the episodes of robots (k,), which stand at their places."""

    def judge(self, robots: np.ndarray, new: np.ndarray, collision: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return rewards (k,) and whether the task is done (k,) after a step in which robots saw `new` cells (k,)."""
        reward = step_reward(self.batch.cells_seen[robots], new, self.batch.grid.total, collision)
        return reward, np.zeros(len(robots), dtype=bool)

    def observed(self, own: np.ndarray, robots: np.ndarray) -> np.ndarray:
        """Return observations (k, features) of robots by their beams and commands, with what this task adds."""
        return own

    def info(self, robots: np.ndarray) -> dict[str, np.ndarray]:
        """Return what this task adds to the info of robots (k,)."""
        return {}
