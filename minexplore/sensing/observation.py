"""What a robot observes: its ranges with noise, scaled, and its previous command."""

from __future__ import annotations

import gymnasium
import numpy as np

from minexplore.task import TaskParams

COMMANDS = 3  # numbers after the ranges: previous forward command, 0, previous turn command


def observation_space(task: TaskParams) -> gymnasium.spaces.Box:
    """Return the space of one robot's observation, (beams + 3,) float32."""
    low = np.array([0.0] * task.beams + [-1.0] * COMMANDS, dtype=np.float32)
    return gymnasium.spaces.Box(low, np.ones_like(low), dtype=np.float32)


def observe(
    task: TaskParams, ranges_m: np.ndarray, previous: np.ndarray, rngs: list[np.random.Generator]
) -> np.ndarray:
    """Return observations (k, beams + 3) float32.

    Parameters
    ----------
    ranges_m : (k, beams)
        True ranges.
    previous : (k, 2)
        The commands of the last step, forward and turn, in [-1, 1].
    rngs : list of k Generators
        Each draws the noise of one robot's beams, in the order of the beams.
    """
    near, far = task.range_m
    noise = np.array([rng.standard_normal(task.beams) for rng in rngs])
    noisy = ranges_m.clip(near, far) + task.range_noise_m * noise
    observed = np.zeros((len(ranges_m), task.beams + COMMANDS), np.float32)
    observed[:, : task.beams] = ((noisy - near) / (far - near)).clip(0.0, 1.0)
    observed[:, task.beams :: 2] = previous
    return observed
