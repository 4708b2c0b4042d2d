"""The classical explorers by name. A new one is a class in a module of this folder and a line of `EXPLORERS`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

from baselines.explorers.frontier import InformationGain, NearestFrontier
from baselines.explorers.graph_explorer import GraphExplorer
from baselines.explorers.graph_gain import GraphInformationGain
from baselines.explorers.in_volume import NearestFrontierInVolume
from baselines.explorers.random_walk import RandomWalk
from baselines.explorers.reactive import Reactive
from baselines.explorers.tour import DepthFirst, FrontierTour, TwoLevel
from baselines.explorers.wall_following import WallFollowing


@dataclass(frozen=True)
class Explorer:
    """The class of an explorer, made as `Class(count, task, robot)`, its class for mines with heights, and for flyers.

    An explorer that keeps no map needs no second class. One without a class for flyers drives on floors only.
    """

    level: Any
    over_heights: Any = None
    flying: Any = None

    def kind(self, heights: bool, flies: bool = False) -> Any:
        """Return the class for a level mine, or for one with heights; or that for robots that fly, None without one."""
        if flies:
            return self.flying
        return self.over_heights or self.level if heights else self.level


def _on_graph(kind: type[GraphExplorer]) -> Explorer:
    return Explorer(kind, partial(kind, heights=True))


EXPLORERS: dict[str, Explorer] = {
    "random": Explorer(RandomWalk),
    "reactive": Explorer(Reactive),
    "wall-following": Explorer(WallFollowing),
    "nearest-frontier": Explorer(NearestFrontier, partial(GraphExplorer, heights=True), NearestFrontierInVolume),
    "information-gain": Explorer(InformationGain, partial(GraphInformationGain, heights=True)),
    "frontier-tour": _on_graph(FrontierTour),
    "depth-first": _on_graph(DepthFirst),
    "two-level": _on_graph(TwoLevel),
}
