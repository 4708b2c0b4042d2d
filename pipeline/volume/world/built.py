"""How much of the surveyed length lies in the free space."""

from __future__ import annotations

import numpy as np

from pipeline.volume.floor_error import ON_WALL_M
from pipeline.volume.rock.inside import Inside
from pipeline.volume.union import Volume
from pipeline.volume.world.topology import LegNetwork

_SAMPLE_M = 0.25
_ABOVE_M = 0.1  # over the floor, where a robot's wheels are


def built_length_m(volume: Volume, legs: LegNetwork) -> float:
    """Return the length, m, of the legs whose line just over their floor is in the free space.

    Both are in one frame. In a passage that is lower than 0.2 m the line is half-way to the roof.
    """
    places, weight = [np.zeros((0, 3))], [np.zeros(0)]
    for leg in legs.legs:
        count = max(1, round(leg.length_m / _SAMPLE_M))
        share = (np.arange(count) + 0.5)[:, None] / count
        ends = np.array([legs.stations_m[leg.start], legs.stations_m[leg.end]])
        up_down = np.array(leg.lrud_m)[:, 2:]
        ends[:, 2] += np.minimum(_ABOVE_M, up_down.sum(axis=1) / 2) - up_down[:, 1]
        places.append(ends[0] * (1 - share) + ends[1] * share)
        weight.append(np.full(count, leg.length_m / count))
    inside = Inside(volume).distance_m(np.concatenate(places)) > -ON_WALL_M
    return float(np.concatenate(weight)[inside].sum())
