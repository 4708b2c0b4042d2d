"""How fast a robot can drive: the commanded speed in its floor zone, and what the dip adds where its wheels slip."""

from __future__ import annotations

import numpy as np

from minexplore.task import TaskParams
from minexplore.world import World

# Of the commanded speed, down the dip of 5 deg: medians over 32 places were 1.00, 1.02 and 1.10.
_DOWNHILL = {"dry": 1.02, "mud": 1.04, "water": 1.12}
_ANY_ZONE = max(_DOWNHILL.values())  # a zone that was not measured gets the fastest: a bound may only be too high
_LEVEL = 1.02


def top_speed_mps(world: World, task: TaskParams, east_m: np.ndarray) -> np.ndarray:
    """Return the mean speed (n,), m/s, that no robot exceeds at eastings (n,), m; noise is added to it."""
    scale = np.array([zone.command_scale for zone in world.active_zones(task.terrain)])
    slip = np.array([_DOWNHILL.get(zone.name, _ANY_ZONE) if task.tilt else _LEVEL for zone in world.floor_zones])
    zones = world.zones_at(east_m)
    return task.max_forward_mps * scale[zones] * slip[zones]


def noise_mps(world: World, task: TaskParams, east_m: np.ndarray) -> np.ndarray:
    """Return the standard deviation (n,), m/s, of the noise on the forward speed at eastings (n,), m."""
    noise = np.array([zone.speed_noise_mps for zone in world.active_zones(task.terrain)])
    return noise[world.zones_at(east_m)]
