"""The explorers for mines with heights: they choose as those for level mines do, on a map of layers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from baselines.explorers.frontier import _GAIN_DECAY_PER_M, _unseen_in_view
from baselines.explorers.graph_explorer import GoalCell, GraphExplorer, Situation
from baselines.explorers.maps.layered_graph import LayeredGraph, LayerGraphs
from baselines.explorers.maps.layers import LayeredMap, Stance, stances_of
from baselines.explorers.tour import DepthFirst, FrontierTour, TwoLevel
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams


class LayeredGround:
    """A map of layers, from stances: height, pitch and roll beside poses.

    Places and paths are those of the mine frame, in which a robot that drives from level to level moves on steadily.
    """

    def __init__(self, task: TaskParams, robot: RobotParams) -> None:
        """Start with an empty map."""
        self.map, self._graphs = LayeredMap(task.cell_m), LayerGraphs(robot.radius_m)
        self._sensor_m = robot.sensor_height_m

    def add(self, stance: Stance, bearings: np.ndarray, ranges: np.ndarray, far_m: float) -> None:
        """Add beams; see `Ground`."""
        self.map.add_scan(stance, bearings, ranges, self._sensor_m, far_m)

    def graph(self, given_up: list[GoalCell], centre: np.ndarray, reach_m: float) -> LayeredGraph | None:
        """Return the graph of all layers; see `Ground`."""
        return self._graphs.graph(self.map, [(col, row, layer) for col, row, layer in given_up], centre, reach_m)

    def has_seen(self, cell: GoalCell) -> bool:
        """Return whether a cell of a layer is seen."""
        *place, layer = cell
        return bool(self.map.layers[layer].has_seen(np.array(place))[0])

    def count_seen(self) -> int:
        """Return how many coverage cells with floors of their own layer are seen."""
        return sum(int((own.seen & self.map.has_own_floor(number)).sum()) for number, own in self.map.layers.items())

    def doubts(self) -> Iterator[Callable[[], bool]]:
        """Return doubts of rock that may be a floor that rises: first of what is nearby, then of all."""
        for layers in ([self.map.layer, *self.map.beside(self.map.layer)], list(self.map.layers)):
            yield partial(self._doubt, layers)

    def _doubt(self, layers: list[int]) -> bool:
        opened = self.map.doubt(layers)
        if opened:
            self._graphs.forget()
        return opened


class OverHeights(GraphExplorer):
    """A `GraphExplorer` whose map has layers."""

    def new_ground(self) -> LayeredGround:
        """Return an empty map."""
        return LayeredGround(self._task, self._robot)

    def stances(self, info: dict[str, Any]) -> Iterator[Stance]:
        """Return how each robot stands (n,)."""
        return stances_of(info)


class NearestFrontierOverHeights(OverHeights):
    """Drives to the nearest cluster of the frontier."""


class InformationGainOverHeights(OverHeights):
    """Drives to the cluster with the most unseen cells in view, discounted by distance, as `InformationGain` does."""

    def choose(self, situation: Situation) -> int:
        """Return the index of the cluster with the greatest gain * exp(-path / 20 m)."""
        graph, gains = situation.graph, []
        for (col, row, _), own in zip(graph.cells[situation.goals].tolist(), graph.maps(situation.goals), strict=True):
            gains.append(_unseen_in_view(own, np.array([row, col]) - own.low[::-1], self._task.range_m[1]))
        return int((np.array(gains) * np.exp(-_GAIN_DECAY_PER_M * situation.costs)).argmax())


class FrontierTourOverHeights(OverHeights, FrontierTour):
    """`FrontierTour` on a map of layers."""


class DepthFirstOverHeights(OverHeights, DepthFirst):
    """`DepthFirst` on a map of layers."""


class TwoLevelOverHeights(OverHeights, TwoLevel):
    """`TwoLevel` on a map of layers."""
