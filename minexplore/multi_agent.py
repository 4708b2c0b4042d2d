"""The exploration task for a team: 1..N robots in one mine that see and hit each other, as a PettingZoo ParallelEnv."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import gymnasium
import mujoco
import numpy as np
from gymnasium.utils import seeding
from pettingzoo import ParallelEnv

from minexplore.explorers import Explorers, as_dict, observation_bounds
from minexplore.lidar import Backend
from minexplore.render import CAMERAS, Renderer
from minexplore.reward import COLLISION_PENALTY, step_reward
from minexplore.robot import RobotParams
from minexplore.task import TaskParams, given
from minexplore.world import World, find_world, load_world

_APART_M = 1.2  # between robots at the start, centre to centre


class Team(Explorers):
    """Robots in one physics model and with one map of what was seen."""

    def __init__(self, world: World, task: TaskParams, robot: RobotParams, count: int, lidar: Backend = "auto") -> None:
        """Compile the mine with all robots."""
        super().__init__(world, task, robot, count, lidar=lidar)
        names = tuple(f"robot_{i}" for i in range(count))
        self.model = self.windows.spec(None, names).compile()
        self.data = mujoco.MjData(self.model)
        joints = [(f"{n}_free", f"{n}_left", f"{n}_right") for n in names]
        wheels = [[int(self.model.joint(j).qposadr[0]) for j in three] for three in joints]
        speeds = [[int(self.model.joint(j).dofadr[0]) for j in three] for three in joints]
        self._qpos_at = np.array([[*range(f, f + 7), left, right] for f, left, right in wheels])
        self._qvel_at = np.array([[*range(f, f + 6), left, right] for f, left, right in speeds])
        self._taken: list[tuple[float, float]] = []
        self.team_seen = np.zeros((1, *self.grid.reachable.shape), dtype=bool)

    def reset_all(self, rngs: list[np.random.Generator]) -> Any:
        """Stand the whole team near the entrance."""
        self._taken = []
        self.team_seen[:] = False
        mujoco.mj_resetData(self.model, self.data)
        outcome = self.reset(np.arange(self.count), rngs)
        self.data.qpos[self._qpos_at] = self.qpos
        mujoco.mj_forward(self.model, self.data)
        return outcome

    def _spawn_place(self, rng: np.random.Generator) -> tuple[float, float]:
        if not self._taken:
            self._taken.append(super()._spawn_place(rng))
            return self._taken[0]
        spawn, world = self.world.record["spawn"], self.world
        row, col = np.nonzero(world.clearance_m >= self.robot.radius_m + 0.1)
        places = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
        apart = np.min([np.linalg.norm(places - taken, axis=1) for taken in self._taken], axis=0) >= _APART_M
        inside = np.linalg.norm(places - spawn["centre_m"], axis=1) <= spawn["radius_m"]
        free = places[apart & inside]
        if not len(free):
            raise ValueError(f"{world.folder}: no room near the entrance for robot {len(self._taken)} of {self.count}")
        x, y = free[rng.integers(len(free))]
        self._taken.append((float(x), float(y)))
        return self._taken[-1]

    def _roll(self, robots: np.ndarray) -> np.ndarray:
        touched = np.zeros(self.count, dtype=bool)
        self.data.ctrl[0::2], self.data.ctrl[1::2] = self.state[:, self.ctrl_at], self.state[:, self.ctrl_at + 1]
        for _ in range(self.task.substeps):
            mujoco.mj_step(self.model, self.data)
            touched |= self.data.sensordata > 0
        self.qpos[:], self.qvel[:] = self.data.qpos[self._qpos_at], self.data.qvel[self._qvel_at]
        return touched[robots]

    def _look(self, robots: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cast beams that rock and the other robots' scanners stop; cells seen by two at once count for the first."""
        origin, directions = self._rays(robots)
        ranges = np.minimum(self.lidar.cast(origin, directions), self._to_others(origin, directions))
        ray, row, col = self._crossed(origin, directions, ranges)
        new = np.zeros(len(robots), dtype=int)
        for i in range(len(robots)):
            own = ray // self.task.beams == i
            new[i] = self.grid.mark(self.team_seen, np.zeros(int(own.sum()), dtype=int), row[own], col[own])[0]
        return ranges, new

    def _to_others(self, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return distances (n, beams) m to the upright cylinders of the other robots' scanners."""
        apart = origin[None, :, :2] - origin[:, None, :2]  # (from, to, 2)
        along = np.einsum("ibk,ijk->ijb", directions[..., :2], apart)
        across = (apart**2).sum(axis=-1)[..., None] - along**2
        half = self.robot.scanner_radius_m**2 - across
        distance = np.where((half > 0) & (along > 0), along - np.sqrt(np.maximum(half, 0.0)), np.inf)
        distance[np.arange(len(origin)), np.arange(len(origin))] = np.inf
        level = origin[:, None, None, 2] + np.where(np.isfinite(distance), distance, 0.0) * directions[:, None, :, 2]
        high = np.abs(level - origin[None, :, None, 2]) <= self.robot.scanner_height_m / 2
        return np.where(high, distance, np.inf).min(axis=1)


class MineParallelEnv(ParallelEnv):
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
        world: str | Path | None = "chilean_mine",
        task: TaskParams | dict[str, Any] | None = None,
        robot: RobotParams | dict[str, Any] | None = None,
        render_mode: str | None = None,
        camera: str = "top",
        lidar: Backend = "auto",
    ) -> None:
        """Load the world and put the team into it."""
        if robots < 1 or reward not in ("shared", "individual"):
            raise ValueError(f"robots = {robots}, reward = {reward!r}: want 1 or more, 'shared' or 'individual'")
        if render_mode not in (None, "rgb_array") or camera not in CAMERAS:
            raise ValueError(f"render_mode = {render_mode!r}, camera = {camera!r}: want None or 'rgb_array', {CAMERAS}")
        self.task, self.robot, self.reward = given(TaskParams, task), given(RobotParams, robot), reward
        self.render_mode, self.camera = render_mode, camera
        self.world = load_world(find_world(world))
        self.team = Team(self.world, self.task, self.robot, robots, lidar)
        self.possible_agents = [f"robot_{i}" for i in range(robots)]
        self.agents: list[str] = []
        self._rngs: list[np.random.Generator] = []
        self._spaces = (
            gymnasium.spaces.Box(*observation_bounds(self.task), dtype=np.float32),
            gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32),
        )
        self.observation_spaces = {
            a: gymnasium.spaces.Box(*observation_bounds(self.task), dtype=np.float32) for a in self.possible_agents
        }
        self.action_spaces = {a: gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32) for a in self.possible_agents}
        self._renderer: Renderer | None = None

    def observation_space(self, agent: str) -> gymnasium.spaces.Box:
        """Return a robot's observation space."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gymnasium.spaces.Box:
        """Return a robot's action space."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, dict[str, Any]]]:
        """Stand the team near the entrance; robot i draws from `seed + i`."""
        if seed is not None or not self._rngs:
            self._rngs = [
                seeding.np_random(None if seed is None else seed + i)[0] for i in range(len(self.possible_agents))
            ]
        self.agents = self.possible_agents[:]
        outcome = self.team.reset_all(self._rngs)
        self.team_cells = int(outcome.info["cells_seen"].sum())
        return self._by_agent(outcome.observation), self._infos(outcome.info)

    def step(
        self, actions: dict[str, np.ndarray]
    ) -> tuple[dict, dict[str, float], dict[str, bool], dict[str, bool], dict]:
        """Step the team."""
        command = np.stack([np.asarray(actions[a], dtype=np.float64) for a in self.possible_agents])
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
        team = {"team_cells_seen": self.team_cells, "team_coverage": self.team_cells / self.team.grid.total}
        return {a: {**as_dict(info, i), **team} for i, a in enumerate(self.possible_agents)}

    def render(self) -> np.ndarray | None:
        """Return a picture (480, 640, 3) uint8 in mode `rgb_array`, else None."""
        if self.render_mode is None:
            return None
        team = self.team
        if self._renderer is None:
            self._renderer = Renderer(self.world, team.T_world_mine, team.grid, self.robot, team.count)
        return self._renderer.draw(self.camera, team.qpos, team.team_seen[0], team.poses())

    def close(self) -> None:
        """Free the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def parallel_env(**kwargs: Any) -> MineParallelEnv:
    """Return the team environment, as PettingZoo's environments are made."""
    return MineParallelEnv(**kwargs)
