"""The exploration task for a team: 1..N robots in one mine that see and hit each other, as a PettingZoo ParallelEnv."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from pettingzoo import ParallelEnv

from minexplore.envs.call_checks import numbers_of, spread_seeds
from minexplore.envs.team import Team
from minexplore.physics.robots import RobotChoice, default_robot
from minexplore.pictures.opengl import prepare_opengl
from minexplore.pictures.render import CAMERAS, Renderer
from minexplore.sensing.lidar import Backend
from minexplore.sensing.observation import observation_space
from minexplore.task import TaskParams, coerce_params
from minexplore.tasks.exploration import COLLISION_PENALTY, info_of_robot, step_reward
from minexplore.world import DEFAULT_WORLD, find_world, load_world

_MOST = 1000  # robots of a team, which one model holds; 20,000 take more than 20 s to make


class MineParallelEnv(ParallelEnv, gymnasium.utils.EzPickle):
    """A team of robots explores one mine; observations and actions of each are those of `MineEnv`.

    Parameters
    ----------
    robots : int
    reward : {"shared", "individual"}
        Shared: every robot gets the reward of the team's new cells and milestones, less the penalty of each collision.
        Individual: each gets its own new cells (seen by two at once, they are the first robot's), the milestones that
        its cells bring the team over, and its own penalties.
    world, task, robot, render_mode, camera, lidar
        As in `MineEnv`. Robots touch each other; only rock counts as a collision.

    Notes
    -----
    The episode ends for all at once: after `task.max_steps`, or when every robot has stalled.
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
        **others: Any,
    ) -> None:
        """Load the world and put the team into it."""
        if others:
            refused = f"{next(iter(others))}: a team explores by its beams and true poses"
            raise ValueError(f"{refused}; goal, sensors, pose and conditions are options of MineEnv and MineVectorEnv")
        gymnasium.utils.EzPickle.__init__(self, robots, reward, world, task, robot, render_mode, camera, lidar)
        if type(robots) is not int or not 1 <= robots <= _MOST or reward not in ("shared", "individual"):
            raise ValueError(
                f"robots = {robots!r}, reward = {reward!r}: want 1 to {_MOST}, and 'shared' or 'individual'"
            )
        if render_mode not in (None, "rgb_array") or camera not in CAMERAS:
            raise ValueError(f"render_mode = {render_mode!r}, camera = {camera!r}: want None or 'rgb_array', {CAMERAS}")
        if render_mode is not None:
            prepare_opengl(render_mode)
        self.task, self.robot, self.reward = coerce_params(TaskParams, task), default_robot(robot, "a team"), reward
        self.render_mode, self.camera = render_mode, camera
        self.world = load_world(find_world(world))
        self.team = Team(self.world, self.task, self.robot, robots, lidar)
        self.possible_agents = [f"robot_{i}" for i in range(robots)]
        self.agents: list[str] = []
        self._rngs: list[np.random.Generator] = []
        self.team_cells = 0
        self.observation_spaces = {a: observation_space(self.task) for a in self.possible_agents}
        self.action_spaces = {a: gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32) for a in self.possible_agents}
        self._renderer: Renderer | None = None
        self._closed = False

    def observation_space(self, agent: str) -> gymnasium.spaces.Box:
        """Return a robot's observation space."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gymnasium.spaces.Box:
        """Return a robot's action space."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, dict[str, Any]]]:
        """Place the team near the entrance; robot i draws from `seed + i`. There are no options; any are ignored."""
        self._require_open()
        seeds = spread_seeds(seed, len(self.possible_agents))
        if seed is not None or not self._rngs:
            self._rngs = [seeding.np_random(one)[0] for one in seeds]
        self.agents = self.possible_agents[:]
        outcome = self.team.reset_all(self._rngs)
        self.team_cells = int(outcome.info["cells_seen"].sum())
        return self._by_agent(outcome.observation), self._infos(outcome.info)

    def step(
        self, actions: dict[str, np.ndarray]
    ) -> tuple[dict, dict[str, float], dict[str, bool], dict[str, bool], dict]:
        """Step the team.

        Raises
        ------
        ValueError
            If an agent has no action, or one that is not two finite numbers, or an agent is unknown.
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
        absent = [agent for agent in self.possible_agents if agent not in actions]
        if absent:
            raise ValueError(f"actions: none for {absent[0]!r}")
        unknown = [agent for agent in actions if agent not in self.possible_agents]
        if unknown:
            raise ValueError(
                f"actions: unknown agent {unknown[0]!r:.80}; there are {self.agents[0]} to {self.agents[-1]}"
            )
        command = numbers_of([actions[agent] for agent in self.possible_agents])
        before = self.team.cells_seen.copy()
        outcome = self.team.step(command, self._rngs)
        reward = self._rewards(self.team.cells_seen - before, outcome.info["collision"])
        over = bool(
            (self.team.stalled >= self.task.stall_steps).all() or (self.team.steps >= self.task.max_steps).all()
        )
        agents = self.agents
        result = (
            self._by_agent(outcome.observation),
            dict(zip(agents, reward.tolist(), strict=True)),
            dict.fromkeys(agents, False),
            dict.fromkeys(agents, over),
            self._infos(outcome.info),
        )
        if over:
            self.agents = []
        return result

    def _rewards(self, new: np.ndarray, collision: np.ndarray) -> np.ndarray:
        total, before = self.team.grid.total, self.team_cells
        self.team_cells += int(new.sum())
        if self.reward == "shared":
            of_team = step_reward(np.array([before]), np.array([new.sum()]), total, np.zeros(1, dtype=bool))[0]
            return np.full(len(new), of_team - COLLISION_PENALTY * collision.sum())
        so_far = before + np.concatenate([[0], np.cumsum(new)[:-1]])
        return step_reward(so_far, new, total, collision)

    def _by_agent(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        return dict(zip(self.possible_agents, rows, strict=True))

    def _infos(self, info: dict[str, np.ndarray]) -> dict[str, dict[str, Any]]:
        cells = np.array([self.team_cells])
        team = {"team_cells_seen": cells, "team_coverage": cells / self.team.grid.total}
        return {a: {**info_of_robot(info, i), **info_of_robot(team, 0)} for i, a in enumerate(self.possible_agents)}

    def render(self) -> np.ndarray | None:
        """Return a picture (480, 640, 3) uint8 in mode `rgb_array`, else None."""
        self._require_open()
        if self.render_mode is None:
            return None
        if not self._rngs:
            raise gymnasium.error.ResetNeeded("call reset before render")
        team = self.team
        if self._renderer is None:
            self._renderer = Renderer(self.world, team.T_world_mine, team.grid, self.robot, team.count)
        return self._renderer.draw(self.camera, team.qpos, team.team_seen[0], team.poses())

    def close(self) -> None:
        """Free the renderer; the environment cannot be used afterwards."""
        self._closed = True
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
        return {**gymnasium.utils.EzPickle.__getstate__(self), "changed": changed, "team": self.team.copy_state()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the environment from its arguments and bring it into its state; windows are not copied."""
        gymnasium.utils.EzPickle.__setstate__(self, state)
        self.team.restore_state(state["team"])
        self.__dict__.update(state["changed"])


def parallel_env(**kwargs: Any) -> MineParallelEnv:
    """Return the team environment, as PettingZoo's environments are made."""
    return MineParallelEnv(**kwargs)
