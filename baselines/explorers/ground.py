"""What a robot knows of the ground by its beams, and the graph that it plans on: on one level, or in layers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any, Protocol

import numpy as np

from baselines.explorers.maps.layered_graph import LayerGraphs
from baselines.explorers.maps.layers import LayeredMap, Stance, stances_of
from baselines.explorers.maps.map_graph import MapGraph, map_graph, worth_driving_to
from baselines.explorers.maps.own_map import OwnMap
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams

GoalCell = tuple[int, ...]  # as the graph's `cells` have it: column and row of a coverage cell, and perhaps its layer


class Ground(Protocol):
    """What a robot, or a team that maps together, knows of the ground by its beams, and the graph that it plans on."""

    map: Any

    def add(self, stance: Any, bearings: np.ndarray, ranges: np.ndarray, far_m: float, robot: int = 0) -> None:
        """Add beams (k,) rad from ahead, m, of a robot; a range of `far_m` is a beam that hit nothing."""

    def graphs(self, given_up: list[GoalCell], centre: np.ndarray, reach_m: float) -> list[MapGraph | None]:
        """Return the graph as each robot plans on it, None for one that has nothing to plan on.

        Its frontier lies within reach of a place (2,) m and was not given up. All have the same nodes.
        """

    def has_seen(self, cell: GoalCell) -> bool:
        """Return whether a cell is seen."""

    def count_seen(self) -> int:
        """Return how many coverage cells are seen."""

    def doubts(self) -> Iterator[Callable[[], bool]]:
        """Return what may be tried where no frontier is near: each opens ground, and returns whether it did."""


class LevelGround:
    """A map of one level, from true poses (x m, y m, heading rad)."""

    def __init__(self, task: TaskParams, robot: RobotParams, robots: int) -> None:
        """Start with an empty map."""
        self.map = OwnMap(task.cell_m)
        self._radius_m, self._robots = robot.radius_m, robots

    def add(self, stance: Any, bearings: np.ndarray, ranges: np.ndarray, far_m: float, robot: int = 0) -> None:
        """Add beams; see `Ground`."""
        self.map.add(stance[:2], stance[2] + bearings, ranges, far_m)

    def graphs(self, given_up: list[GoalCell], centre: np.ndarray, reach_m: float) -> list[MapGraph | None]:
        """Return the graph of the map for each robot; see `Ground`."""
        keep = worth_driving_to(self.map, [(col, row) for col, row in given_up], centre, reach_m)
        graph = map_graph(self.map, self._radius_m, keep)
        return [graph if len(graph.cells) else None] * self._robots

    def has_seen(self, cell: GoalCell) -> bool:
        """Return whether a cell is seen."""
        col, row = np.array(cell) - self.map.low
        return bool(self.map.seen[row, col])

    def count_seen(self) -> int:
        """Return how many coverage cells are seen."""
        return int(self.map.seen.sum())

    def doubts(self) -> Iterator[Callable[[], bool]]:
        """Return nothing: on one level rock is rock."""
        return iter(())


class LayeredGround:
    """A map of layers, from stances: height, pitch and roll beside poses.

    Places and paths are those of the mine frame, in which a robot that drives from level to level moves on steadily.
    """

    def __init__(self, task: TaskParams, robot: RobotParams, robots: int) -> None:
        """Start with an empty map."""
        self.map, self._graphs = LayeredMap(task.cell_m), LayerGraphs(robot.radius_m)
        self._sensor_m, self._robots = robot.sensor_height_m, robots

    def add(self, stance: Stance, bearings: np.ndarray, ranges: np.ndarray, far_m: float, robot: int = 0) -> None:
        """Add beams; see `Ground`."""
        self.map.add_scan(stance, bearings, ranges, self._sensor_m, far_m, robot)

    def graphs(self, given_up: list[GoalCell], centre: np.ndarray, reach_m: float) -> list[MapGraph | None]:
        """Return the graph of all layers for each robot; see `Ground`."""
        cells = [(col, row, layer) for col, row, layer in given_up]
        graph = self._graphs.graph(self.map, cells, centre, reach_m)
        return [graph and graph.in_layer(self.map.layer_of[robot]) for robot in range(self._robots)]

    def has_seen(self, cell: GoalCell) -> bool:
        """Return whether a cell of a layer is seen."""
        *place, layer = cell
        return bool(self.map.layers[layer].has_seen(np.array(place))[0])

    def count_seen(self) -> int:
        """Return how many coverage cells with floors of their own layer are seen."""
        return sum(int((own.seen & self.map.has_own_floor(number)).sum()) for number, own in self.map.layers.items())

    def doubts(self) -> Iterator[Callable[[], bool]]:
        """Return doubts of rock that may be a floor that rises: first of what is nearby, then of all."""
        for layers in (self.map.near_robots(), self.map.layers):
            yield partial(self._doubt, list(layers))

    def _doubt(self, layers: list[int]) -> bool:
        opened = self.map.doubt(layers)
        if opened:
            self._graphs.forget()
        return opened


def new_ground(task: TaskParams, robot: RobotParams, heights: bool, robots: int = 1) -> Ground:
    """Return an empty map of a mine, with heights or level, for robots that map together."""
    return (LayeredGround if heights else LevelGround)(task, robot, robots)


def stances_in(info: dict[str, Any], heights: bool) -> Iterable[Any]:
    """Return how each robot stands, as the ground of a mine with heights, or of a level one, takes it."""
    return stances_of(info) if heights else info["pose_m_rad"]
