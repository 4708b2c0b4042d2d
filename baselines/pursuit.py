"""Drive along a path: aim at a point some way ahead on it, slower for what is near, never into what is close."""

from __future__ import annotations

import math

import numpy as np

_AHEAD_M = 1.4  # of the point aimed at
_CLOSE_M, _FREE_M = 0.55, 1.6  # of what stands in the way: stand still; full speed


def follow(
    path: np.ndarray, pose: np.ndarray, bearings: np.ndarray, ranges: np.ndarray, max_turn_radps: float = 1.5
) -> tuple[float, float]:
    """Return the command (forward, turn) in [-1, 1] that takes a robot along a path.

    Parameters
    ----------
    path : (n, 2) m
        From where the robot is, or nearly, to where it is to go.
    pose : (3,)
        x, y, m, and yaw, rad.
    bearings, ranges : (k,) rad, m
        The robot's beams in its own frame, within pi of ahead.
    """
    beside = np.linalg.norm(path - pose[:2], axis=1)
    nearest = int(beside.argmin())
    beyond = np.flatnonzero(beside[nearest:] > _AHEAD_M)
    aim = path[nearest + beyond[0]] if len(beyond) else path[-1]
    east, north = aim - pose[:2]
    error = (math.atan2(north, east) - pose[2] + math.pi) % (2 * math.pi) - math.pi
    turn = float(np.clip(2.2 * error / max_turn_radps, -1, 1))
    off = np.abs(bearings)
    across, along = ranges * np.sin(off), ranges * np.cos(off)
    in_the_way = (off < np.pi / 3) & (across < 0.55)
    room = float(along[in_the_way].min(initial=np.inf))
    forward = float(np.clip((room - _CLOSE_M) / (_FREE_M - _CLOSE_M), 0, 1) * np.clip(1.25 * np.cos(error), 0, 1))
    if room < _CLOSE_M and abs(error) < np.pi / 4:  # what the map does not show is in the way: turn to more room
        left = ranges[(bearings > 0) & (bearings < np.pi / 2)].mean()
        right = ranges[(bearings < 0) & (bearings > -np.pi / 2)].mean()
        return -0.3, 0.6 if left > right else -0.6
    return forward, turn
