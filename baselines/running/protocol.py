"""The protocol: how the episodes of a policy are run, and what is recorded of each."""

from __future__ import annotations

import dataclasses
import importlib.metadata
import platform
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import minexplore
from baselines.base.result_file import FORMAT, SAMPLE_STEPS, Episode, Head
from baselines.policies.policy_lookup import Policy, policy_sha256
from minexplore.envs.vector import MineVectorEnv
from minexplore.physics.robot_kind import Robot
from minexplore.task import TaskParams

SEEDS = tuple(range(20))  # of the episodes that a policy's results consist of: all of them, and no others
SPLIT_SEEDS = (0,)  # the same of a mine of a split, which has many mines
_PACKAGES = ("minexplore-pipeline", "mujoco", "numpy", "gymnasium")


def seeds_of(env_id: str) -> tuple[int, ...]:
    """Return the seeds that results in an environment consist of."""
    return SPLIT_SEEDS if env_id in minexplore.FAMILY_MINES else SEEDS


def name_episode(env_id: str, seed: int) -> str:
    """Return what a message calls an episode: its seed, or the mine of a split, each of which has one episode."""
    return env_id if env_id in minexplore.FAMILY_MINES else f"seed {seed}"


def head_of(env_id: str, env: MineVectorEnv, label: str, policy: Policy, seeds: list[int]) -> Head:
    """Return a results file's first line."""
    versions = {package: _version(package) for package in _PACKAGES} | {"python": platform.python_version()}
    return Head(
        format=FORMAT,
        env=env_id,
        world_sha256=env.world.record["world_sha256"],
        task=params_facts(env.task),
        robot=params_facts(env.robot),
        cells=env.robots.grid.total,
        policy=label,
        policy_sha256=policy_sha256(policy),
        versions=versions,
        seeds=seeds,
    )


def params_facts(params: TaskParams | Robot) -> dict[str, Any]:
    """Return the numbers of a task or a robot as JSON holds them."""
    return {
        k: list(v) if isinstance(v, tuple) else str(v) if v == np.inf else v
        for k, v in dataclasses.asdict(params).items()  # type: ignore[arg-type]
    }


class _Recorder:
    """What is recorded of the episodes of n robots while they drive."""

    def __init__(self, seeds: list[int], max_steps: int, info: dict[str, Any]) -> None:
        count = len(seeds)
        self._seeds = seeds
        self._seen, self._path = np.zeros((count, max_steps + 1), dtype=int), np.zeros((count, max_steps + 1, 2))
        self._seen[:, 0], self._path[:, 0] = info["cells_seen"], info["pose_m_rad"][:, :2]
        self._steps, self._idle, self._collided = (np.zeros(count, dtype=int) for _ in range(3))
        self._returned = np.zeros(count)

    def add(self, robots: np.ndarray, reward: np.ndarray, info: dict[str, Any]) -> None:
        """Record one step of robots (k,); rewards and infos have a row for each of all n robots."""
        self._steps[robots] += 1
        now = self._steps[robots]
        self._seen[robots, now], self._path[robots, now] = info["cells_seen"][robots], info["pose_m_rad"][robots, :2]
        self._idle[robots] += self._seen[robots, now] == self._seen[robots, now - 1]
        self._collided[robots] += info["collision"][robots]
        self._returned[robots] += reward[robots]

    def episode(self, robot: int) -> Episode:
        """Return one robot's episode."""
        last = int(self._steps[robot])
        samples = [*range(0, last, SAMPLE_STEPS), last]
        path = self._path[robot]
        return Episode(
            seed=self._seeds[robot],
            steps=last,
            seen=self._seen[robot, samples].tolist(),
            path_cm=[(x, y) for x, y in np.rint(100 * path[samples]).astype(int).tolist()],
            idle=int(self._idle[robot]),
            collided=int(self._collided[robot]),
            previous="",
            returned=round(float(self._returned[robot]), 6),
            path_m=round(float(np.linalg.norm(np.diff(path[: last + 1], axis=0), axis=1).sum()), 3),
        )


def run_episodes(
    env: MineVectorEnv, policy: Policy, seeds: list[int], step_done: Callable[[int], Any] = lambda count: None
) -> Iterator[Episode]:
    """Run one episode of each seed, all robots at once, and yield the episodes in the order of the seeds.

    `step_done` is called after each step with the number of robots that are still driving.
    """
    robots = np.arange(len(seeds))
    observation, info = env.reset(seed=seeds)
    policy.reset(robots, np.array(seeds))
    recorder = _Recorder(seeds, env.task.max_steps, info)
    driving = np.ones(len(seeds), dtype=bool)
    while driving.any():
        action = np.asarray(policy.act(observation, info), dtype=np.float64)
        observation, reward, _, truncated, info = env.step(action)
        recorder.add(robots[driving], reward, info)  # robots whose episode is over have begun another one
        step_done(int(driving.sum()))
        driving &= ~truncated
    for robot in robots.tolist():
        yield recorder.episode(robot)


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return minexplore.__version__ if package.startswith("minexplore") else "absent"
