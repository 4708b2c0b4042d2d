"""Many robots, each alone in its own copy of one mine: spawn, physics, beams, coverage, reward and ends of episodes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from minexplore.envs.ground import RobotGround, ground_of
from minexplore.envs.robot_places import RobotPlaces
from minexplore.physics.robot_kind import DrivenRobot, Robot
from minexplore.physics.stepper import PhysicsStepper
from minexplore.sensing.coverage import mark
from minexplore.sensing.lidar import Backend, shared_lidar
from minexplore.sensing.observation import observe
from minexplore.task import TaskParams
from minexplore.tasks.exploration import Exploration, StepOutcome
from minexplore.world import World

if TYPE_CHECKING:
    from minexplore.tasks.starts import EpisodeStart

_COUNTED = {2: "two", 4: "four"}
# Arrays with a row for each robot that hold what changes while it drives.
_CHANGES = ("state", "seen", "cells_seen", "previous", "steps", "stalled", "collisions")


class RobotBatch(RobotPlaces):
    """The state of n robots and their episodes: `reset` some, `step` some or all."""

    def __init__(
        self,
        world: World,
        task: TaskParams,
        robot: Robot,
        count: int,
        threads: int = 1,
        lidar: Backend = "auto",
        whole: bool = False,
    ) -> None:
        """Take a world; `whole` steps every robot in the model of all rock, for comparison."""
        if not isinstance(whole, bool):
            raise ValueError(f"whole = {whole!r}: want True or False")
        self.world, self.task, self.robot, self.count = world, task, robot, count
        self._every = np.arange(count)
        self.ground = self._make_ground(whole)
        self.local_models, self.T_world_mine = self.ground.models, self.ground.T_world_mine
        self._R, self._t = self.T_world_mine[:3, :3], self.T_world_mine[:3, 3]
        self.lidar = shared_lidar(world.folder, world.record["world_sha256"], task.range_m[1], lidar)
        self.grid = self.ground.grid
        angles = [math.tau * k / task.beams for k in range(task.beams)]
        self._beams = np.array([(math.cos(angle), math.sin(angle)) for angle in angles])
        zones = world.active_zones(task.terrain)
        self._scale = np.array([zone.command_scale for zone in zones])
        self._noise = np.array([zone.speed_noise_mps for zone in zones])
        self.stepper = self._make_stepper(threads)
        self.state, self.qpos, self.qvel = self.stepper.state, self.stepper.qpos, self.stepper.qvel
        self.seen = np.zeros((count, *self.grid.reachable.shape), dtype=bool)
        self.cells_seen, self._reachable = np.zeros(count, dtype=int), np.full(count, self.grid.total)
        self.previous = np.zeros((count, robot.COMMANDS))
        self.steps, self.stalled, self.collisions = (np.zeros(count, dtype=int) for _ in range(3))
        self.rules = Exploration(self)

    def _make_ground(self, whole: bool) -> RobotGround:
        """Return what the robots move over."""
        return ground_of(self.world, self.task, self.robot, self.count, whole)

    def _make_stepper(self, threads: int) -> PhysicsStepper:
        """Return what holds the robots' states and advances them."""
        return PhysicsStepper(self.local_models, self.count, threads, self.ground.start_m)

    def surfaces_round(self, robot: int, surfaces: Any) -> Any:
        """Return what casts the rays of a robot's LiDARs, by what casts them at rock: nothing else is round a robot."""
        return surfaces

    def reset(
        self, robots: np.ndarray, rngs: list[np.random.Generator], start: EpisodeStart | None = None
    ) -> StepOutcome:
        """Place robots (k,) near the entrance with a random yaw, or as `start` says, and cast the beams once."""
        for i in robots.tolist():
            self.place(i, *self._start_pose(i, rngs[i], start))
        self.seen[robots], self.previous[robots] = False, 0.0
        for counter in (self.steps, self.stalled, self.collisions, self.cells_seen):
            counter[robots] = 0
        self.rules.begin(robots)
        ranges, new = self._look(robots)
        self.cells_seen[robots] = new  # no step earned these cells
        nothing = np.zeros(len(robots), dtype=bool)
        observation = self.rules.observed(self._observe(robots, ranges, rngs), robots)
        ends = nothing.copy(), nothing.copy()
        return StepOutcome(observation, np.zeros(len(robots)), *ends, self._info(robots, nothing))

    def _start_pose(self, robot: int, rng: np.random.Generator, start: EpisodeStart | None) -> list[float]:
        """Return x, y, yaw and, where it is known, z at which a robot begins."""
        x, y, *z = self.rules.place(robot, rng, start) or self._sample_place(rng)
        pose = [x, y, rng.uniform(-np.pi, np.pi), *z]
        return pose if start is None else start.pose(pose, robot, rng)

    def place(self, robot: int, x_m: float, y_m: float, yaw_rad: float, z_m: float | None = None) -> None:
        """Place a robot, at rest, on the floor at a pose of the plan; in a volume on the next floor under a height."""
        self.stepper.restart(robot)
        place = np.array([x_m, y_m] if z_m is None else [x_m, y_m, z_m])
        self.qpos[robot, :7] = self.ground.pose(place, yaw_rad)

    def _sample_place(self, rng: np.random.Generator) -> list[float]:
        """Return the anchor, or where that is too narrow a random place (m) of the entrance region."""
        spawn = self.world.record["spawn"]
        if spawn["anchor_clearance_m"] >= spawn["clearance_m"] >= self.robot.radius_m:
            return list(spawn["anchor_m"])
        near = self._entrance_places(self.robot.radius_m)
        if not len(near):
            raise ValueError(f"{self.world.folder}: the robot ({self.robot.radius_m} m) fits nowhere near the entrance")
        found: list[float] = near[rng.integers(len(near))].tolist()
        return found

    def _entrance_places(self, clearance_m: float) -> np.ndarray:
        """Return the places (n, 2 or 3) m of the entrance region that have a clearance."""
        spawn, places = self.world.record["spawn"], self.ground.places(clearance_m)
        found: np.ndarray = places[np.linalg.norm(places - spawn["centre_m"], axis=1) <= spawn["radius_m"]]
        return found

    def step(
        self, actions: np.ndarray, rngs: list[np.random.Generator], robots: np.ndarray | None = None
    ) -> StepOutcome:
        """Drive robots for one control step and cast the beams.

        Parameters
        ----------
        actions : (n, 2)
            Forward speed and turn rate in [-1, 1]; clipped.
        rngs : list of Generator
            One a robot.
        robots : (k,) int, optional
            Which robots drive; all by default. The outcome has k rows.

        Raises
        ------
        ValueError
            If an action is not finite or the shape is wrong; it names the robot.
        """
        robots = self._every if robots is None else robots
        rows = self._rows(robots)
        command = self._commands(actions, robots)
        collision = self.drive(command, rngs, robots)
        self.collisions[rows] += collision
        self.previous[rows] = command
        ranges, new = self._look(robots)
        self.steps[rows] += 1
        reward, done = self.rules.judge(robots, new, collision)
        self.cells_seen[rows] += new
        # In mud and water noise moves a robot that is commanded to stand, so the command counts too.
        still = np.minimum(self._speeds(robots), self._asked_speeds(command)) < self.task.stall_speed_mps
        self.stalled[rows] = (self.stalled[rows] + 1) * still
        truncated = (self.steps[rows] >= self.task.max_steps) | (self.stalled[rows] >= self.task.stall_steps)
        observation = self.rules.observed(self._observe(robots, ranges, rngs), robots)
        return StepOutcome(observation, reward, done, truncated, self._info(robots, collision))

    def _asked_speeds(self, command: np.ndarray) -> np.ndarray:
        """Return the speeds (k,) m/s along their way that commands (k, commands) ask for."""
        return np.asarray(self.task.max_forward_mps * np.abs(command[:, 0]))

    def _commands(self, actions: np.ndarray, robots: np.ndarray) -> np.ndarray:
        command, wanted = np.asarray(actions, dtype=np.float64), (self.count, self.robot.COMMANDS)
        if command.shape != wanted:
            raise ValueError(f"actions of shape {command.shape}: want {wanted}")
        finite = np.isfinite(command)
        if np.count_nonzero(finite) < finite.size:
            i = int((~finite).any(axis=1).argmax())
            several = f"{_COUNTED[self.robot.COMMANDS]} finite numbers in [-1, 1]"
            raise ValueError(f"action of robot {i} = {command[i].tolist()}: want {several}")
        # The action space's 32 bits: what a policy computes may differ between processors in the last of 64.
        return command[self._rows(robots)].clip(-1.0, 1.0).astype(np.float32).astype(np.float64)

    def drive(self, command: np.ndarray, rngs: list[np.random.Generator], robots: np.ndarray) -> np.ndarray:
        """Advance robots (k,) by one control step without casting beams.

        Parameters
        ----------
        command : (k, 2)
            Forward speed and turn rate in [-1, 1].
        rngs : list of Generator
            One for each of all robots.
        robots : (k,) int

        Returns
        -------
        (k,) bool
            Whether the chassis touched rock in any physics step.
        """
        assert isinstance(self.robot, DrivenRobot)
        task, places = self.task, self._mine_places(robots)
        zone = self.world.zones_at(places[:, 0])
        scale = self._scale[zone]
        forward = command[:, 0] * task.max_forward_mps * scale
        for k in self._noise[zone].nonzero()[0].tolist():
            forward[k] += rngs[robots[k]].normal(0.0, self._noise[zone[k]])
        turn = command[:, 1] * task.max_turn_radps * scale
        forward, turn = self.robot.disturb(forward, turn, rngs, robots)
        self.stepper.ctrl[self._rows(robots)] = self.robot.controls(forward, turn)
        self.ground.brake(robots, places, self.qvel)
        return self._advance(robots, places)

    def _advance(self, robots: np.ndarray, places_m: np.ndarray) -> np.ndarray:
        """Step the physics of robots (k,) at places (k, 3) m for one control step; return which touched rock."""
        return self.stepper.advance(robots, self.ground.prepare(self.stepper, robots, places_m), self.task.substeps)

    def true_ranges(self, robots: np.ndarray) -> np.ndarray:
        """Return the ranges (k, beams) m of robots' beams without noise; nothing counts as seen."""
        return self._cast(robots)[2]

    def _look(self, robots: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cast the beams and mark the cells they cross; return true ranges (k, beams) m, and new cells (k,)."""
        origin, directions, ranges = self._cast(robots)
        ray, *cell = self._crossed(origin, directions, ranges)
        new = mark(self.grid, self.seen, robots[ray // len(self._beams)], *cell)
        return ranges, new[self._rows(robots)]

    def _cast(self, robots: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the beams' origins (k, 3) m, directions (k, beams, 3) and true ranges (k, beams) m, mine frame."""
        now = self._stances(robots)
        lift = self.robot.sensor_height_m - self.robot.wheel_radius_m
        origin = now.places_m + lift * now.axes[:, 2]
        directions = self._beams[:, :1] * now.axes[:, None, 0] + self._beams[:, 1:] * now.axes[:, None, 1]
        return origin, directions, self.lidar.cast(origin, directions)

    def _crossed(self, origin: np.ndarray, directions: np.ndarray, ranges: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return ray numbers, and the indices of the cells that the beams pass through."""
        ends = origin[:, None] + directions * ranges[..., None]
        starts = origin if len(origin) == 1 else origin.repeat(len(self._beams), axis=0)
        return self.grid.cells_crossed(starts, ends.reshape(-1, 3), self.task.range_m[1])

    def _observe(self, robots: np.ndarray, ranges: np.ndarray, rngs: list[np.random.Generator]) -> np.ndarray:
        return observe(self.task, ranges, self.previous[self._rows(robots)], [rngs[i] for i in robots.tolist()])

    def _info(self, robots: np.ndarray, collision: np.ndarray) -> dict[str, np.ndarray]:
        now, rows = self._stances(robots), self._rows(robots)
        seen, attitude = self.cells_seen[rows].copy(), self._attitudes_of(now)
        return {
            "cells_seen": seen,
            "cells_reachable": self._reachable[rows].copy(),
            "coverage": seen / self.grid.total,
            "collision": np.asarray(collision),
            "collisions": self.collisions[rows].copy(),
            "zone": self.world.zones_at(now.places_m[:, 0]),
            "pose_m_rad": now.poses(),
            "height_m": self._heights_of(now),
            "pitch_rad": attitude[:, 0],
            "roll_rad": attitude[:, 1],
            **self.ground.info(robots, now.places_m),
            **self.rules.info(robots),
        }

    def copy_state(self) -> dict[str, Any]:
        """Return a copy of all that changes while robots drive; their random numbers are the caller's."""
        return {name: getattr(of, name).copy() for of, name in self._changing()}

    def restore_state(self, state: dict[str, Any]) -> None:
        """Take what `copy_state` returned, of a batch of as many robots in the same world."""
        for of, name in self._changing():
            getattr(of, name)[...] = state[name]

    def _changing(self) -> list[tuple[Any, str]]:
        return [(self, name) for name in _CHANGES] + [(self.rules, name) for name in self.rules.CHANGES]

    def close(self) -> None:
        """Stop the threads."""
        self.stepper.close()
