"""What explorers lose by odometry, dust and water: `python -m benchmarks sensing-loss`, for the leaderboard.

It goes on where it ended.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from typing import Any

import gymnasium
import numpy as np

from baselines.base.environments import find_id
from baselines.base.result_file import line_sha256
from baselines.policies.policy_lookup import Policy, make_policy, policy_sha256
from baselines.scoring.degraded import DRIVEN, TRUE, Drives, degraded_table, keep_drives, read_degraded
from minexplore.envs.vector import MineVectorEnv
from minexplore.sensing.odometry import fitted_odometry
from minexplore.sensing.params import preset_names, preset_numbers

ENV = "MineXplore/ChileanMineEntrance-v0"


def all_senses() -> dict[str, dict[str, Any]]:
    """Return the arguments of `MineVectorEnv` by the name of the senses."""
    presets = {name: {"conditions": name} for name in preset_names()}
    return {TRUE: {}, "odometry": {"pose": "odometry"}, **{k: v for k, v in presets.items() if k != TRUE}}


def explore(policy_name: str, env_id: str, seeds: list[int], senses: dict[str, Any], known: str = "") -> Drives | None:
    """Return what a policy's episodes come to; None if they would be those of the inputs that are known."""
    env = MineVectorEnv(len(seeds), **{**gymnasium.spec(env_id).kwargs, **senses})
    policy = make_policy(policy_name, len(seeds), env.task, env.robot, env.world.has_heights)
    inputs = _inputs(policy, env, senses)
    if inputs == known:
        env.close()
        return None
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
    return Drives(inputs_sha256=inputs, episodes=len(seeds), coverage=coverage, collisions=collisions, off_m=off_m)


def _inputs(policy: Policy, env: MineVectorEnv, senses: dict[str, Any]) -> str:
    """Return a hash of all that decides how a policy's episodes go, but their seeds."""
    about = {
        "world": env.world.record["world_sha256"],
        "task": dataclasses.asdict(env.task),
        "policy": policy_sha256(policy),
        "conditions": preset_numbers(senses["conditions"]) if "conditions" in senses else {},
        "odometry": dataclasses.asdict(fitted_odometry()) if "pose" in senses else {},
    }
    return line_sha256(json.dumps(about, sort_keys=True))


def main() -> int:
    """Run the explorers and keep their results; the leaderboard has the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--policy", nargs="*", default=DRIVEN)
    parser.add_argument("--env", default=ENV)
    parser.add_argument("--episodes", type=int, default=6)
    arguments = parser.parse_args()
    env_id, seeds = find_id(arguments.env), list(range(arguments.episodes))
    for policy in arguments.policy:
        for name, senses in all_senses().items():
            kept = read_degraded().get(env_id, {}).get(policy, {}).get(name)
            known = kept.inputs_sha256 if kept is not None and kept.episodes >= len(seeds) else ""
            drives = explore(policy, env_id, seeds, senses, known)
            if drives is not None:
                keep_drives(env_id, policy, name, drives)
            print(policy, name, drives or "current", flush=True)
    print(degraded_table(read_degraded()[env_id]), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
