"""The protocol: episodes of a policy in an environment, and all that is written down of each."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib.metadata
import json
import platform
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

import minexplore
from baselines.errors import BaselineError
from baselines.policy import Policy, policy_sha256
from minexplore.task import TaskParams
from minexplore.vector import MineVectorEnv

FORMAT = "minexplore-results/1"
SAMPLE_STEPS = 20  # control steps between samples of the coverage curve and the path: 2 s
_PACKAGES = ("minexplore-pipeline", "mujoco", "numpy", "gymnasium")


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Head(_Strict):
    """The first line of a results file: what was run, where, with what."""

    format: str
    env: str
    world_sha256: str
    task: dict[str, Any]
    cells: int = Field(gt=0)
    policy: str
    policy_sha256: str
    versions: dict[str, str]
    seeds: list[int] = Field(min_length=1)


class Episode(_Strict):
    """One line an episode. Samples are taken every 2 s, the first at rest and the last at the end.

    `seen` counts cells, `path_cm` is x, y in the mine frame, `idle` counts steps that saw nothing new, `collided` those
    that touched rock; `path_m` is the sum over all control steps. `previous` is the hash of the line before.
    """

    seed: int
    steps: int = Field(ge=1)
    seen: list[int] = Field(min_length=2)
    path_cm: list[tuple[int, int]] = Field(min_length=2)
    idle: int = Field(ge=0)
    collided: int = Field(ge=0)
    path_m: float = Field(ge=0, allow_inf_nan=False)
    returned: float = Field(allow_inf_nan=False)
    previous: str


Progress = Callable[[int], Any]


def make_env(env_id: str, robots: int, threads: int = 1) -> MineVectorEnv:
    """Return the vector environment of an id.

    Raises
    ------
    BaselineError
        If there is no such id, or its world is not built.
    """
    if env_id not in minexplore.WORLDS:
        raise BaselineError(f"env = {env_id!r}: valid choices are {', '.join(minexplore.WORLDS)}")
    try:
        return MineVectorEnv(robots, threads=threads, **minexplore.WORLDS[env_id])
    except FileNotFoundError as error:
        raise BaselineError(f"{env_id}: {error}") from error


def head_of(env_id: str, env: MineVectorEnv, name: str, policy: Policy, seeds: list[int]) -> Head:
    """Return a results file's first line."""
    versions = {package: _version(package) for package in _PACKAGES} | {"python": platform.python_version()}
    return Head(
        format=FORMAT, env=env_id, world_sha256=env.world.record["world_sha256"], task=task_facts(env.task),
        cells=env.explorers.grid.total, policy=name, policy_sha256=policy_sha256(policy), versions=versions,
        seeds=seeds,
    )  # fmt: skip


def task_facts(task: TaskParams) -> dict[str, Any]:
    """Return a task's numbers as JSON has them."""
    return {
        k: list(v) if isinstance(v, tuple) else str(v) if v == np.inf else v
        for k, v in dataclasses.asdict(task).items()
    }


def run_episodes(env: MineVectorEnv, policy: Policy, seeds: list[int], step_done: Progress) -> Iterator[Episode]:
    """Run one episode of each seed, all robots at once, and give the episodes in the order of the seeds.

    `step_done` is called with the number of robots that made a step.
    """
    robots = np.arange(len(seeds))
    observation, info = env.reset(seed=seeds)
    policy.reset(robots, np.array(seeds))
    task = env.task
    seen = np.zeros((len(seeds), task.max_steps + 1), dtype=int)
    path = np.zeros((len(seeds), task.max_steps + 1, 2))
    seen[:, 0], path[:, 0] = info["cells_seen"], info["pose_m_rad"][:, :2]
    steps, idle, collided, returned = (np.zeros(len(seeds)) for _ in range(4))
    driving = np.ones(len(seeds), dtype=bool)
    while driving.any():
        action = np.asarray(policy.act(observation, info), dtype=np.float64)
        observation, reward, _, truncated, info = env.step(action)
        at = robots[driving]  # one whose episode is over has begun another, which counts for nothing
        steps[at] += 1
        now = steps[at].astype(int)
        seen[at, now], path[at, now] = info["cells_seen"][at], info["pose_m_rad"][at, :2]
        idle[at] += seen[at, now] == seen[at, now - 1]
        collided[at] += info["collision"][at]
        returned[at] += reward[at]
        step_done(len(at))
        driving[at] = ~truncated[at]
    for i, seed in enumerate(seeds):
        last = int(steps[i])
        samples = [*range(0, last, SAMPLE_STEPS), last]
        yield Episode(
            seed=seed, steps=last, seen=seen[i, samples].tolist(),
            path_cm=np.rint(100 * path[i, samples]).astype(int).tolist(),
            idle=int(idle[i]), collided=int(collided[i]), returned=round(float(returned[i]), 6), previous="",
            path_m=round(float(np.linalg.norm(np.diff(path[i, : last + 1], axis=0), axis=1).sum()), 3),
        )  # fmt: skip


def chain(head: Head, episodes: list[Episode]) -> str:
    """Return a results file's text: each line holds the hash of the one before it."""
    lines = [head.model_dump_json()]
    for episode in episodes:
        lines.append(episode.model_copy(update={"previous": line_sha256(lines[-1])}).model_dump_json())
    return "\n".join(lines) + "\n"


def line_sha256(line: str) -> str:
    """Return the hash of a line of a results file, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(json.loads(line), sort_keys=True).encode()).hexdigest()


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return minexplore.__version__ if package.startswith("minexplore") else "absent"
