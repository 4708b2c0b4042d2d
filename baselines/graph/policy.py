"""The learned graph explorer as a policy: the classical ones' map, graph and follower, and a network that chooses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from baselines.explorers.graph_explorer import STILL_M, Driver, GraphExplorer, Situation
from baselines.graph.checkpoint import read_network
from baselines.graph.choosing import LearnedChoice
from baselines.graph.features import Context
from baselines.graph.floor_speeds import FloorSpeeds
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams


class GraphPolicy(GraphExplorer):
    """Drives to the cluster of the frontier that a network scores highest; it needs neither torch nor Ray."""

    def __init__(self, path: Path, count: int, task: TaskParams, robot: RobotParams, heights: bool = False) -> None:
        """Read the network.

        Raises
        ------
        BaselineError
            If there is no such file, or it holds no network.
        """
        self.path = path
        self._choice = LearnedChoice(*read_network(path))
        self._steps, self._anchored = np.zeros(count, dtype=int), np.zeros(count, dtype=int)
        self._anchors, self._poses = np.full((count, 2), np.inf), np.zeros((count, 3))
        self._starts, self._forward = np.zeros((count, 2)), np.zeros(count)
        self._floor = FloorSpeeds(task, count)
        super().__init__(count, task, robot, heights)

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Empty the maps of robots (k,)."""
        super().reset(robots, seeds)
        self._steps[robots], self._anchored[robots], self._anchors[robots] = 0, 0, np.inf

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2)."""
        self._poses = info["pose_m_rad"]
        fresh, places = self._steps == 0, self._poses[:, :2]
        first, driving = np.flatnonzero(fresh), np.flatnonzero(~fresh)
        self._starts[first] = places[first]
        self._floor.begin(first, places[first])
        self._floor.note(driving, places[driving], self._forward[driving])
        self._steps += 1
        moved = np.linalg.norm(self._poses[:, :2] - self._anchors, axis=1) > STILL_M
        self._anchors[moved], self._anchored[moved] = self._poses[moved, :2], self._steps[moved]
        commands = super().act(observation, info)
        self._forward = commands[:, 0]
        return commands

    def _choose(self, driver: Driver, situation: Situation) -> int:
        robot, step_s = self._drivers.index(driver), self._task.control_s
        held_s = driver.steps_to_goal * step_s
        still_s = min((self._steps[robot] - self._anchored[robot]) * step_s, held_s)
        left_s = (self._task.max_steps - self._steps[robot]) * step_s
        pose, start, floor = self._poses[robot], self._starts[robot], self._floor.of(robot)
        return self._choice(situation, Context(driver.ground.count_seen(), pose, start, left_s, still_s, held_s, floor))
