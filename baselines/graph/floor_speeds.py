"""What floors allow, as robots measure it: the share of the commanded speed that they have reached, and where."""

from __future__ import annotations

import numpy as np

from minexplore.task import TaskParams

_WINDOW_STEPS = 10  # control steps that one measurement takes
_LEAST_COMMAND = 0.8  # on average: a robot that turns or creeps measures nothing


class FloorSpeeds:
    """Measurements of n robots, from their own poses and commands only."""

    def __init__(self, task: TaskParams, count: int) -> None:
        """Start with none."""
        self._step_m = task.max_forward_mps * task.control_s  # in a control step at the full command
        self._measured = np.zeros((count, task.max_steps // _WINDOW_STEPS + 1, 3))
        self._count, self._steps = np.zeros(count, dtype=int), np.zeros(count, dtype=int)
        self._commanded, self._from = np.zeros(count), np.zeros((count, 2))

    def begin(self, robots: np.ndarray, places: np.ndarray) -> None:
        """Forget what robots (k,) have measured; they are at places (k, 2) m."""
        self._count[robots], self._steps[robots], self._commanded[robots] = 0, 0, 0.0
        self._from[robots] = places

    def note(self, robots: np.ndarray, places: np.ndarray, forward: np.ndarray) -> None:
        """Take one control step of robots (k,).

        Parameters
        ----------
        robots : (k,) int
        places : (k, 2) m
            After the step.
        forward : (k,)
            What was commanded, in [-1, 1].
        """
        self._steps[robots] += 1
        self._commanded[robots] += forward
        full = self._steps[robots] >= _WINDOW_STEPS
        ended, at = robots[full], places[full]
        driven_m = np.linalg.norm(at - self._from[ended], axis=1)
        sure = self._commanded[ended] >= _LEAST_COMMAND * _WINDOW_STEPS
        share = driven_m[sure] / (self._commanded[ended[sure]] * self._step_m)
        place = np.minimum(self._count[ended[sure]], self._measured.shape[1] - 1)
        self._measured[ended[sure], place] = np.column_stack([at[sure], share])
        self._count[ended[sure]] = place + 1
        self._steps[ended], self._commanded[ended], self._from[ended] = 0, 0.0, at

    def of(self, robot: int) -> np.ndarray:
        """Return a robot's measurements (m, 3), oldest first: x, y, m, and the share of the commanded speed."""
        return self._measured[robot, : self._count[robot]]
