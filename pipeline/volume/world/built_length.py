"""How much of the surveyed length lies in the free space."""

from __future__ import annotations

import numpy as np

from pipeline.volume.floor_error import ON_WALL_M
from pipeline.volume.union import Volume
from pipeline.volume.world.topology import LegNetwork

_SAMPLE_M = 0.25
_ABOVE_M = 0.1  # over the floor, where a robot's wheels are


def built_length_m(volume: Volume, legs: LegNetwork) -> float:
    """Return the length, m, of all legs that is built, as `built_lengths_m` has it of each."""
    return float(built_lengths_m(volume, legs).sum())


def built_lengths_m(volume: Volume, legs: LegNetwork) -> np.ndarray:
    """Return the length (n,) m of each leg whose line just over its floor is in the free space.

    Both are in one frame. In a passage that is lower than 0.2 m the line is half-way to the roof.
    """
    places, weight, of_leg = [np.zeros((0, 3))], [np.zeros(0)], [np.zeros(0, int)]
    for number, leg in enumerate(legs.legs):
        count = max(1, round(leg.length_m / _SAMPLE_M))
        share = (np.arange(count) + 0.5)[:, None] / count
        ends = np.array([legs.stations_m[leg.start], legs.stations_m[leg.end]])
        up_down = np.array(leg.lrud_m)[:, 2:]
        ends[:, 2] += np.minimum(_ABOVE_M, up_down.sum(axis=1) / 2) - up_down[:, 1]
        places.append(ends[0] * (1 - share) + ends[1] * share)
        weight.append(np.full(count, leg.length_m / count))
        of_leg.append(np.full(count, number))
    inside = volume.inside.distance_m(np.concatenate(places)) > -ON_WALL_M
    return np.bincount(np.concatenate(of_leg)[inside], np.concatenate(weight)[inside], len(legs.legs))
