"""Evaluate an explorer of your own by the leaderboard's protocol: `python examples/custom_explorer.py`.

It needs a checkout: the wheel has no baselines.
"""

import argparse
from pathlib import Path

import numpy as np

from baselines.base.beams import beam_bearings, beam_ranges
from baselines.evaluate import evaluate, print_table
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams


class LongestBeam:
    """Turns towards the longest beam of the front half and drives slower when the front is blocked."""

    def __init__(self, count: int, task: TaskParams, robot: RobotParams) -> None:
        """Select the beams of the front half."""
        self.task, self.radius_m = task, robot.radius_m
        self.bearings = beam_bearings(task)
        self.front = np.flatnonzero(np.abs(self.bearings) <= np.pi / 2)

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Begin new episodes; this policy has no state."""

    def act(self, observation: np.ndarray, info: dict) -> np.ndarray:
        """Return commands (n, 2) in [-1, 1]."""
        ranges_m = beam_ranges(observation, self.task)[:, self.front]
        bearing = self.bearings[self.front][ranges_m.argmax(axis=1)]
        nearest_m = ranges_m.min(axis=1) - self.radius_m
        return np.column_stack([np.clip(nearest_m, 0.1, 1.0), np.clip(2 * bearing, -1.0, 1.0)])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--env", default="MineXplore/ChileanMineEntrance-v0")
    parser.add_argument("--episodes", type=int, default=10)
    parser.add_argument("--out", type=Path, default=Path("longest-beam.jsonl"), help="the results file")
    arguments = parser.parse_args()
    # A policy of another package is named by its module and class; the file's folder is on Python's path.
    seeds = list(range(arguments.episodes))
    print_table(*evaluate("custom_explorer:LongestBeam", arguments.env, seeds, arguments.out))
