"""The beams of an observation: their directions and their ranges in metres."""

from __future__ import annotations

import numpy as np

from minexplore.task import TaskParams


def beam_bearings(task: TaskParams) -> np.ndarray:
    """Return the beams' bearings (beams,), rad in [-pi, pi): 0 is ahead, positive is left."""
    return (2 * np.pi * np.arange(task.beams) / task.beams + np.pi) % (2 * np.pi) - np.pi


def beam_ranges(observation: np.ndarray, task: TaskParams) -> np.ndarray:
    """Return the beams' ranges (n, beams), m, of observations (n, features)."""
    near, far = task.range_m
    return near + observation[:, : task.beams].astype(float) * (far - near)
