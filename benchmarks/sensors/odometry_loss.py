"""What explorers lose that know their pose by odometry: `python -m benchmarks odometry-loss`."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from baselines.base.markdown import markdown_table, write_table
from baselines.explorers import EXPLORERS
from baselines.policies.found import make_policy
from minexplore.envs.sensed.odometry_batch import POSES
from minexplore.envs.vector import MineVectorEnv

PAGE = Path("docs/evidence/parts/odometry-loss.md")
_COLUMNS = (
    "explorer",
    "coverage by the true pose",
    "by odometry",
    "lost",
    "collisions",
    "by odometry",
    "off at the end, m",
)
ENV = "MineXplore/ChileanMineEntrance-v0"


@dataclass(frozen=True)
class Drives:
    """Means of some episodes: coverage, collisions, and how far the known pose is off at the end, m."""

    coverage: float
    collisions: float
    off_m: float


def explore(policy_name: str, env_id: str, seeds: list[int], **arguments: Any) -> Drives:
    """Return what a policy's episodes come to; `arguments` are those of `MineVectorEnv`."""
    env = MineVectorEnv(len(seeds), **{**gymnasium.spec(env_id).kwargs, **arguments})
    policy = make_policy(policy_name, len(seeds), env.task, env.robot, not env.world.floor.is_flat)
    observation, info = env.reset(seed=seeds)
    policy.reset(np.arange(len(seeds)), np.array(seeds))
    ended = np.zeros(len(seeds), dtype=bool)
    last = np.zeros((len(seeds), 3))
    while not ended.all():
        observation, _, _, truncated, info = env.step(policy.act(observation, info))
        true = info.get("true_pose_m_rad", info["pose_m_rad"])
        off = np.linalg.norm(true[:, :2] - info["pose_m_rad"][:, :2], axis=1)
        last[~ended] = np.column_stack([info["coverage"], info["collisions"], off])[~ended]
        ended |= truncated
    env.close()
    return Drives(*last.mean(axis=0).tolist())


def row_of(policy: str, env_id: str, seeds: list[int]) -> list[str]:
    """Return one explorer's row."""
    known, counted = (explore(policy, env_id, seeds, pose=pose) for pose in POSES)
    covered = [known.coverage, counted.coverage, known.coverage - counted.coverage]
    others = [known.collisions, counted.collisions, counted.off_m]
    return [policy, *(f"{100 * share:.1f} %" for share in covered), *(f"{number:.1f}" for number in others)]


def main() -> int:
    """Run the explorers and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--policy", nargs="*", default=[name for name in EXPLORERS if name != "random"])
    parser.add_argument("--env", default=ENV)
    parser.add_argument("--episodes", type=int, default=2)
    arguments = parser.parse_args()
    rows = []
    for policy in arguments.policy:
        rows.append(row_of(policy, arguments.env, list(range(arguments.episodes))))
        print(*rows[-1], flush=True)
    about = f"Means of {arguments.episodes} episodes each in `{arguments.env}`.\n\n"
    write_table(PAGE, about + markdown_table(_COLUMNS, rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
