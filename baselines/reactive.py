"""The heuristic of the paper's authors: straight on, slower near something, towards the side with more room."""

from __future__ import annotations

from typing import Any

import numpy as np

from minexplore.task import TaskParams

_CLEAR, _SLOW, _GAIN = 0.5, 0.3, 0.5  # of the scaled range; forward command; turn by the difference of the sides


class Reactive:
    """Full speed while the beams ahead are clear, else a third of it; turns by the room on the left less the right.

    As its authors describe it: no memory, no way back from a wall that it has met.
    """

    def __init__(self, robots: int, task: TaskParams) -> None:
        """Find the beams ahead and at the sides."""
        quarter = task.beams // 4
        self._ahead = [0, 1, task.beams - 1]
        self._left, self._right = [quarter, quarter + 1], [3 * quarter, 3 * quarter + 1]

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Begin new episodes: there is nothing to forget."""

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        forward = np.where(observation[:, self._ahead].min(axis=1) > _CLEAR, 1.0, _SLOW)
        turn = _GAIN * (observation[:, self._left].sum(axis=1) - observation[:, self._right].sum(axis=1))
        return np.column_stack([forward, turn])
