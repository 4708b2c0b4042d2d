"""The classical explorers by name. A new one is a class in a module of this folder and a line of `EXPLORERS`."""

from __future__ import annotations

from typing import Any

from baselines.explorers.frontier import InformationGain, NearestFrontier
from baselines.explorers.random_walk import RandomWalk
from baselines.explorers.reactive import Reactive
from baselines.explorers.tour import DepthFirst, FrontierTour, TwoLevel
from baselines.explorers.wall_following import WallFollowing

EXPLORERS: dict[str, Any] = {  # name: class, made as Class(count, task, robot)
    "random": RandomWalk,
    "reactive": Reactive,
    "wall-following": WallFollowing,
    "nearest-frontier": NearestFrontier,
    "information-gain": InformationGain,
    "frontier-tour": FrontierTour,
    "depth-first": DepthFirst,
    "two-level": TwoLevel,
}
