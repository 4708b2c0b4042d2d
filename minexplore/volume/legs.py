"""The names of a volume's legs."""

from __future__ import annotations

import json

from minexplore.bundle import TOPOLOGY
from minexplore.world import World


def leg_names(world: World) -> list[str]:
    """Return the stations at both ends of each leg, by its number."""
    legs = json.loads(world.read(TOPOLOGY))["legs"]
    return [f"{leg['start']} to {leg['end']}" for leg in legs]
