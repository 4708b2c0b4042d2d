"""A team: 1..N robots in one mine that see and hit each other, as a PettingZoo ParallelEnv."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from pettingzoo import ParallelEnv

from minexplore.envs.batches import commands_of, make_batch, observations_of
from minexplore.envs.call_checks import check_options, numbers_of, spread_seeds
from minexplore.envs.sensed.sensed_rows import SensedRows
from minexplore.envs.team import Team
from minexplore.physics.robots import RobotChoice, find_robot
from minexplore.pictures.opengl import prepare_opengl
from minexplore.pictures.render import CAMERAS, Renderer
from minexplore.sensing.lidar import Backend
from minexplore.sensing.params import SensorParams, sensor_params
from minexplore.sensors.table import check_sensors, observed_space
from minexplore.task import TaskParams, coerce_params
from minexplore.tasks.exploration import COLLISION_PENALTY, StepOutcome, info_of_robot, step_reward
from minexplore.world import DEFAULT_WORLD, find_world, load_world

if TYPE_CHECKING:
    from minexplore.tasks.goto import GoalParams

_MOST = 1000  # robots of a team, which one model holds; 20,000 take more than 20 s to make


class MineParallelEnv(ParallelEnv, gymnasium.utils.EzPickle):
    """A team of robots in one mine; observations, actions and infos of each are those of `MineEnv`.

    Parameters
    ----------
    robots : int
    reward : {"shared", "individual"}
        Shared: every robot gets the reward of the team's new cells and milestones, less the penalty of each collision.
        Individual: each gets its own new cells (seen by two at once, they are the first robot's), the milestones that
        its cells bring the team over, and its own penalties. With goals the shared reward is the sum of all own ones.
    world, task, robot, render_mode, camera, lidar, pose, sensors, conditions, goal
        As in `MineEnv`. Robots touch each other; only rock counts as a collision. Beams and LiDARs hit the other
        robots, and images show them. The map is the team's.

    Notes
    -----
    The episode is truncated for all at once: after `task.max_steps`, or when every robot has stalled. A robot that has
    reached its goal is terminated: it leaves `agents` and stays where it is, commanded to stand.
    """

    metadata = {"name": "minexplore_v0", "render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        robots: int = 2,
        reward: Literal["shared", "individual"] = "shared",
        world: str | Path | None = DEFAULT_WORLD,
        task: TaskParams | dict[str, Any] | None = None,
        robot: RobotChoice = None,
        render_mode: str | None = None,
        camera: str = "top",
        lidar: Backend = "auto",
        pose: str = "true",
        sensors: Sequence[str] = (),
        conditions: SensorParams | Mapping[str, Any] | str | None = None,
        goal: GoalParams | Mapping[str, Any] | None = None,
    ) -> None:
        """Load the world and put the team into it."""
        given = (robots, reward, world, task, robot, render_mode, camera, lidar, pose, sensors, conditions, goal)
        gymnasium.utils.EzPickle.__init__(self, *given)
        if type(robots) is not int or not 1 <= robots <= _MOST or reward not in ("shared", "individual"):
            raise ValueError(
                f"robots = {robots!r}, reward = {reward!r}: want 1 to {_MOST}, and 'shared' or 'individual'"
            )
        if render_mode not in (None, "rgb_array") or camera not in CAMERAS:
            raise ValueError(f"render_mode = {render_mode!r}, camera = {camera!r}: want None or 'rgb_array', {CAMERAS}")
        if render_mode is not None:
            prepare_opengl(render_mode)
        self.task, self.robot, self.reward = coerce_params(TaskParams, task), find_robot(robot), reward
        self.render_mode, self.camera = render_mode, camera
        self.world, conditions = load_world(find_world(world)), sensor_params(conditions)
        one = (self.world, self.task, self.robot)
        self.team = cast(Team, make_batch(*one, robots, 1, lidar, False, pose, conditions, goal, together=True))
        self.possible_agents = [f"robot_{i}" for i in range(robots)]
        self.agents: list[str] = []
        self._rngs: list[np.random.Generator] = []
        self.team_cells, self._has_goals = 0, goal is not None
        names, own = check_sensors(sensors), observations_of(self.task, self.robot, goal, self.world.has_heights)
        self.observation_spaces = {a: observed_space(own, names) for a in self.possible_agents}
        self.action_spaces = {a: commands_of(self.robot) for a in self.possible_agents}
        self._renderer: Renderer | None = None
        self._sensed = SensedRows(self.team, names, self._drawing, conditions, lidar)
        self._closed = False

    def observation_space(self, agent: str) -> gymnasium.spaces.Space:
        """Return a robot's observation space."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gymnasium.spaces.Box:
        """Return a robot's action space."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Place the team near the entrance, or as options say; robot i draws from `seed + i`.

        The options are those of `MineEnv.reset` and hold for each robot; where one stands already, the next begins at
        the nearest place that is free.
        """
        self._require_open()
        check_options(options, (*self.team.rules.OPTIONS, "options"))  # PettingZoo's own test gives one of this name
        count = len(self.possible_agents)
        seeds, start = spread_seeds(seed, count), self.team.rules.start_of(options)
        if seed is not None or not self._rngs:
            self._rngs = [seeding.np_random(one)[0] for one in seeds]
        outcome = self.team.reset_all(self._rngs, start)
        self.agents = self.possible_agents[:]
        self.team_cells = int(outcome.info["cells_seen"].sum())
        noise = None if start is None else start.noise_seed
        return self._observed(outcome, seeds if noise is None else range(noise, noise + count)), self._infos(outcome)

    def step(
        self, actions: dict[str, np.ndarray]
    ) -> tuple[dict, dict[str, float], dict[str, bool], dict[str, bool], dict]:
        """Step the team.

        Raises
        ------
        ValueError
            If an agent has no action, or one that is not as many finite numbers as drive it, or an agent is unknown.
        gymnasium.error.ResetNeeded
            Before the first reset, and after the episode's end.
        gymnasium.error.ClosedEnvironmentError
            After `close`.
        """
        self._require_open()
        if not isinstance(actions, Mapping):
            raise ValueError(f"actions = {actions!r:.80}: want a dict with an action for each robot")
        if not self.agents:
            raise gymnasium.error.ResetNeeded("call reset before step: no robot is driving")
        agents = self.agents
        absent = [agent for agent in agents if agent not in actions]
        if absent:
            raise ValueError(f"actions: none for {absent[0]!r}")
        unknown = [agent for agent in actions if agent not in self.possible_agents]
        if unknown:
            raise ValueError(
                f"actions: unknown agent {unknown[0]!r:.80}; there are {self.agents[0]} to {self.agents[-1]}"
            )
        still = np.zeros(self.action_spaces[self.possible_agents[0]].shape)  # of robots that are at their goals
        command = numbers_of([actions[agent] if agent in agents else still for agent in self.possible_agents])
        before = self.team.cells_seen.copy()
        outcome = self.team.step(command, self._rngs)
        reward = self._rewards(outcome, self.team.cells_seen - before)
        left = np.array([agent not in agents for agent in self.possible_agents])
        idle = left | outcome.terminated | (self.team.stalled >= self.task.stall_steps)
        over = bool(idle.all() or (self.team.steps >= self.task.max_steps).all())
        done = dict(zip(self.possible_agents, outcome.terminated.tolist(), strict=True))
        result = (
            self._observed(outcome),
            {agent: reward[agent] for agent in agents},
            {agent: done[agent] for agent in agents},
            {agent: over and not done[agent] for agent in agents},
            self._infos(outcome),
        )
        self.agents = [] if over else [agent for agent in agents if not done[agent]]
        return result

    def _rewards(self, outcome: StepOutcome, new: np.ndarray) -> dict[str, float]:
        """Return each robot's reward of a step in which robots saw `new` cells (n,) that the team had not seen."""
        own, collision = outcome.reward, outcome.info["collision"]
        before, total = self.team_cells, self.team.grid.total
        self.team_cells += int(new.sum())
        if self._has_goals:
            on_way = np.array([agent in self.agents for agent in self.possible_agents])
            reward = np.full(len(new), own[on_way].sum()) if self.reward == "shared" else own
        elif self.reward == "shared":
            of_team = step_reward(np.array([before]), np.array([new.sum()]), total, np.zeros(1, dtype=bool))[0]
            reward = np.full(len(new), of_team - COLLISION_PENALTY * collision.sum())
        else:
            reward = step_reward(before + np.concatenate([[0], np.cumsum(new)[:-1]]), new, total, collision)
        return dict(zip(self.possible_agents, reward.tolist(), strict=True))

    def _observed(self, outcome: StepOutcome, seeds: Sequence[int | None] | None = None) -> dict[str, Any]:
        """Return what robots observe that are on their way: arrays, or with sensors dicts of them."""
        self._sensed.take(np.arange(len(self.possible_agents)), seeds)
        readings = self._sensed.readings
        found = {}
        for i, agent in enumerate(self.possible_agents):
            if agent in self.agents:
                own = outcome.observation[i]
                found[agent] = {"robot": own, **{name: rows[i].copy() for name, rows in readings.items()}}
        return found if readings else {agent: one["robot"] for agent, one in found.items()}

    def _infos(self, outcome: StepOutcome) -> dict[str, dict[str, Any]]:
        cells = np.array([self.team_cells])
        team = {"team_cells_seen": cells, "team_coverage": cells / self.team.grid.total}
        rows = [(i, agent) for i, agent in enumerate(self.possible_agents) if agent in self.agents]
        return {agent: {**info_of_robot(outcome.info, i), **info_of_robot(team, 0)} for i, agent in rows}

    def render(self) -> np.ndarray | None:
        """Return a picture (480, 640, 3) uint8 in mode `rgb_array`, else None."""
        self._require_open()
        if self.render_mode is None:
            return None
        if not self._rngs:
            raise gymnasium.error.ResetNeeded("call reset before render")
        return self._drawing().draw(self.camera, self.team.qpos, self.team.team_seen[0], self.team.poses())

    def _drawing(self) -> Renderer:
        if self._renderer is None:
            team = self.team
            self._renderer = Renderer(self.world, team.T_world_mine, team.grid, self.robot, team.count)
        return self._renderer

    def close(self) -> None:
        """Free the renderer; the environment cannot be used afterwards."""
        self._closed = True
        self._sensed.close()
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _require_open(self) -> None:
        if self._closed:
            raise gymnasium.error.ClosedEnvironmentError("the environment is closed: make another one")

    def __getstate__(self) -> dict[str, Any]:
        """Return the arguments and all that has changed since; a copy goes on as this environment does."""
        names = ("agents", "_rngs", "team_cells", "_closed")
        changed = {name: getattr(self, name) for name in names}
        states = {"changed": changed, "team": self.team.copy_state(), "sensed": self._sensed.copy_state()}
        return {**gymnasium.utils.EzPickle.__getstate__(self), **states}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the environment from its arguments and bring it into its state; windows are not copied."""
        gymnasium.utils.EzPickle.__setstate__(self, state)
        self.team.restore_state(state["team"])
        self._sensed.restore_state(state["sensed"])
        self.__dict__.update(state["changed"])


def parallel_env(**kwargs: Any) -> MineParallelEnv:
    """Return the team environment, as PettingZoo's environments are made."""
    return MineParallelEnv(**kwargs)
