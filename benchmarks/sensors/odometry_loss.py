"""What explorers lose that know their pose by odometry: `python -m benchmarks odometry-loss`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import gymnasium
import numpy as np

from baselines.base.markdown import markdown_table, write_table
from baselines.explorers import EXPLORERS
from baselines.policies.found import make_policy
from minexplore.envs.odometry_batch import POSES
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
_ENV = "MineXplore/ChileanMineEntrance-v0"


def explore(policy_name: str, env_id: str, pose: str, seeds: list[int]) -> tuple[float, float, float]:
    """Return the mean coverage, collisions, and error of the pose at the end, m, of a policy's episodes."""
    env = MineVectorEnv(len(seeds), pose=pose, **gymnasium.spec(env_id).kwargs)
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
    coverage, collisions, off_m = last.mean(axis=0).tolist()
    return coverage, collisions, off_m


def row_of(policy: str, env_id: str, seeds: list[int]) -> list[str]:
    """Return one explorer's row."""
    (known, hits, _), (counted, other_hits, off_m) = (explore(policy, env_id, pose, seeds) for pose in POSES)
    shares = [f"{100 * known:.1f} %", f"{100 * counted:.1f} %", f"{100 * (known - counted):.1f} %"]
    return [policy, *shares, f"{hits:.1f}", f"{other_hits:.1f}", f"{off_m:.1f}"]


def main() -> int:
    """Run the explorers and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--policy", nargs="*", default=[name for name in EXPLORERS if name != "random"])
    parser.add_argument("--env", default=_ENV)
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
