"""How fast a robot can be: as commanded in its zone, and what the dip adds where its wheels slip."""

from __future__ import annotations

import numpy as np

from minexplore.task import TERRAIN, TaskParams
from minexplore.world import World

# Of the commanded speed, down the dip of 5 deg: medians over 32 places were 1.00, 1.02 and 1.10.
_DOWNHILL = {"dry": 1.02, "mud": 1.04, "water": 1.12}
_LEVEL = 1.02


def top_speed_mps(world: World, task: TaskParams, east_m: np.ndarray) -> np.ndarray:
    """Return the mean speed (n,) that no robot exceeds at eastings (n,), m; noise comes on top of it."""
    scale = np.array([TERRAIN.get(g.name, (1.0, 0.0))[0] if task.terrain else 1.0 for g in world.grounds])
    spare = np.array([_DOWNHILL.get(g.name, _LEVEL) if task.tilt else _LEVEL for g in world.grounds])
    zones = world.zones_at(east_m)
    return task.max_forward_mps * scale[zones] * spare[zones]
