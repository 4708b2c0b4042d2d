"""A fast simulator of exploration: robots drive along paths of their own maps, without physics, in one mine.

Beams, coverage, map and follower are those of the environment and of the classical graph explorers. The robot
accelerates evenly to what is commanded and does not slip. The beams are cast every second control step.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.ndimage import map_coordinates

from baselines.explorers.graph_explorer import Situation
from baselines.graph.features import Context
from baselines.graph.floor_speeds import FloorSpeeds
from baselines.graph.map_stack import MapStack
from baselines.graph.planner import ClusterPlanner
from baselines.graph.training.convoy import Convoy
from baselines.graph.training.senses import Senses
from minexplore.physics.robot import RobotParams
from minexplore.sensing.coverage import mark
from minexplore.task import TaskParams
from minexplore.world import World

_LOOK_STEPS = 2  # control steps between scans
_ACCELERATION = np.array([4.6, 12.0])  # m/s^2, rad/s^2: of the robot in the environment on dry, level floor

Choose = Callable[[np.ndarray, list[Situation]], list[int]]  # robots (k,) and what each decides by -> clusters


class MapSimulator:
    """The state of n robots, each alone in its own copy of a mine.

    Attributes
    ----------
    poses : (n, 3)
        x, y, m, and yaw, rad, in the mine frame.
    time_s : (n,)
    cells_seen : (n,) int
    planners : list of ClusterPlanner
    """

    def __init__(self, world: World, task: TaskParams, robot: RobotParams, count: int, replan_steps: int = 15) -> None:
        """Take a mine; call `reset` before anything else."""
        self.world, self.task, self.robot, self.count = world, task, robot, count
        self._replan_steps = replan_steps
        self.senses = Senses(world, task, robot)
        self.horizon_s = task.max_steps * task.control_s
        self._convoy, self._floor = Convoy(task, robot, count), FloorSpeeds(task, count)
        self._scale = np.array([zone.command_scale for zone in world.active_zones(task.terrain)])
        self._maps = MapStack(self.senses.grid, count)
        self._seen = np.zeros((count, *self.senses.grid.reachable.shape), dtype=bool)
        self.poses, self.time_s, self.cells_seen = np.zeros((count, 3)), np.zeros(count), np.zeros(count, dtype=int)
        self._ranges, self._true = np.zeros((count, task.beams)), np.zeros((count, task.beams))
        self._speeds = np.zeros((count, 2))  # forward, m/s, and turn, rad/s
        self.planners: list[ClusterPlanner] = [self._planner(i) for i in range(count)]

    def _planner(self, robot: int) -> ClusterPlanner:
        return ClusterPlanner(self._maps.view(robot), self.task, self.robot, self.poses[robot, :2], self._replan_steps)

    def reset(self, robots: np.ndarray, yaws: np.ndarray, rng: np.random.Generator) -> None:
        """Begin episodes of robots (k,) at the anchor of the spawn, with yaws (k,) rad."""
        anchor_m = self.world.record["spawn"]["anchor_m"]
        for robot, yaw in zip(robots.tolist(), yaws, strict=True):
            self.poses[robot] = [*anchor_m, yaw]
            self._maps.clear(robot)
            self._seen[robot], self.time_s[robot], self.cells_seen[robot], self._speeds[robot] = False, 0.0, 0, 0.0
            self.planners[robot] = self._planner(robot)
            self._convoy.take(robot, None)
        self._floor.begin(robots, self.poses[robots, :2])
        self._measure(robots, rng)
        self._look(robots)

    def run(self, choose: Choose, robots: np.ndarray, until_s: np.ndarray, rng: np.random.Generator) -> None:
        """Drive robots (k,) until their times (n,) s; `choose` is asked whenever some of them want a plan."""
        driving = robots[self.time_s[robots] < until_s[robots] - 1e-9]
        while len(driving):
            self._plan(choose, driving)
            for _ in range(_LOOK_STEPS):
                self._drive(driving)
            self._measure(driving, rng)
            self._look(driving)
            driving = driving[self.time_s[driving] < until_s[driving] - 1e-9]

    def _plan(self, choose: Choose, robots: np.ndarray) -> None:
        """Ask for the clusters to drive to, and take the paths."""
        found = {i: self.planners[i].look_around(self.poses[i, :2]) for i in self._undecided(robots)}
        asked = {i: situation for i, situation in found.items() if situation is not None}
        chosen = choose(np.array(list(asked), dtype=int), list(asked.values())) if asked else []
        decided = dict(zip(asked, chosen, strict=True))
        for i, situation in found.items():
            self.send(i, situation, decided.get(i))

    def _undecided(self, robots: np.ndarray) -> list[int]:
        for i in robots.tolist():
            self.planners[i].step = round(self.time_s[i] / self.task.control_s)
        return [i for i in robots.tolist() if self.planners[i].wants_a_plan(self.poses[i, :2])]

    def context(self, robot: int) -> Context:
        """Return what a robot's decision depends on beside its situation."""
        planner, step_s = self.planners[robot], self.task.control_s
        held_s = planner.steps_to_goal * step_s
        still_s = min(planner.still_steps * step_s, held_s)
        left_s = self.horizon_s - self.time_s[robot]
        return Context(
            int(planner.map.seen.sum()),
            self.poses[robot],
            planner.start,
            left_s,
            still_s,
            held_s,
            self._floor.of(robot),
        )

    def send(self, robot: int, situation: Situation | None, chosen: int | None) -> None:
        """Let a robot drive to a cluster of its situation."""
        self.planners[robot].head_for(situation, chosen)
        self._convoy.take(robot, self.planners[robot].path)

    def _drive(self, robots: np.ndarray) -> None:
        """Move robots (k,) for one control step; a robot that would enter rock stops and turns."""
        step_s, pose = self.task.control_s, self.poses[robots]
        commands = self._convoy.follow(robots, pose, self._ranges[robots])
        scale = self._scale[self.world.zones_at(pose[:, 0])][:, None]
        wanted = commands * [self.task.max_forward_mps, self.task.max_turn_radps] * scale
        before, most = self._speeds[robots], _ACCELERATION * step_s
        speeds = before + np.clip(wanted - before, -most, most)
        length, turned = (before + speeds).T / 2 * step_s
        heading = pose[:, 2] + turned / 2
        place = pose[:, :2] + length[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
        clearance = self._clearance(place)
        fits = (clearance >= self.robot.radius_m) | (clearance >= self._clearance(pose[:, :2]))
        self.poses[robots, :2] = np.where(fits[:, None], place, pose[:, :2])
        self.poses[robots, 2] = (pose[:, 2] + turned + np.pi) % (2 * np.pi) - np.pi
        self._speeds[robots] = speeds * np.column_stack([fits, np.ones(len(robots))])
        self.time_s[robots] += step_s
        self._floor.note(robots, self.poses[robots, :2], commands[:, 0])

    def _clearance(self, places: np.ndarray) -> np.ndarray:
        """Return the distances (k,) m to rock, linear between the cells of the grid; 0 beyond the world."""
        at = (places - self.world.origin_m) / self.world.cell_m - 0.5
        return map_coordinates(self.world.clearance_m, at[:, ::-1].T, order=1, mode="grid-constant")

    def _measure(self, robots: np.ndarray, rng: np.random.Generator) -> None:
        """Cast the beams of robots (k,); what they measure has noise."""
        near_m, far_m = self.task.range_m
        self._true[robots] = ranges = self.senses.cast(self.poses[robots])
        noise = self.task.range_noise_m * rng.standard_normal(ranges.shape)
        self._ranges[robots] = np.clip(np.clip(ranges, near_m, far_m) + noise, near_m, far_m)

    def _look(self, robots: np.ndarray) -> None:
        """Count the new cells that the last beams of robots (k,) cross, and add the beams to the maps."""
        poses = self.poses[robots]
        pose, row, col = self.senses.cells(poses, self._true[robots])
        self.cells_seen += mark(self.senses.grid, self._seen, robots[pose], row, col)
        self._maps.add(robots, poses, self.senses.bearings, self._ranges[robots], self.task.range_m[1])
        self._note_changes(robots, poses)

    def _note_changes(self, robots: np.ndarray, poses: np.ndarray) -> None:
        """Enlarge the boxes of the maps' cells that have changed since the last plan."""
        reach = self.task.range_m[1] + self.task.cell_m / 2
        low = np.floor((poses[:, :2] - reach) / self.task.cell_m).astype(int) - self._maps.low
        high = np.floor((poses[:, :2] + reach) / self.task.cell_m).astype(int) - self._maps.low + 1
        for i, (left, bottom), (right, top) in zip(robots.tolist(), low.tolist(), high.tolist(), strict=True):
            row, col, end_row, end_col = self.planners[i].changed
            changed = [min(row, bottom), min(col, left), max(end_row, top), max(end_col, right)]
            self.planners[i].changed = changed
