"""The environment on Warp beside that on the CPU: `make parity-gpu` (docs/evidence/parts/gpu-parity.md)."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any

from baselines.base.environments import find_id
from baselines.base.errors import BaselineError
from baselines.base.markdown import write_table
from baselines.policies.policy_lookup import make_policy
from benchmarks.speed.gpu_pair import Pair, compare_looks, compare_steps, drive_episodes, stress
from benchmarks.speed.gpu_parity_page import EPISODES, rows, tables
from minexplore.extra.warp import require_device, require_packages
from minexplore.task import TaskParams
from minexplore.world import find_world, load_world

PAGE = Path("docs/evidence/parts/gpu-parity.md")
POLICIES = ("wall-following", "ChileanMineEntrance-beams-mlp-42")
_WORLD = "chilean_mine"
_NO_DEVICE = 3  # exit code


def measure(asked: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """Return by part how far the CPU and a device differ, with the counts of the command line."""
    pair = Pair(load_world(find_world(_WORLD)), asked.robots, asked.device)
    found = {
        "looks": compare_looks(pair, asked.rays),
        "steps": compare_steps(pair, asked.steps),
        "stress": stress(pair, asked.contacts),
    }
    return found | {f"{EPISODES}{name}": _drive(name, asked) for name in asked.policy}


def _drive(name: str, asked: argparse.Namespace) -> dict[str, Any]:
    """Return return and coverage of whole episodes on the CPU and on the device, as many as there are robots."""
    import gymnasium

    import minexplore  # noqa: F401  registers the environments

    kwargs: dict[str, Any] = {"num_envs": asked.robots, "vectorization_mode": "vector_entry_point"}
    cpu: Any = gymnasium.make_vec(asked.env, **kwargs, threads=os.cpu_count() or 1)
    warp: Any = gymnasium.make_vec(asked.env, **kwargs, backend="warp", device=asked.device, numpy=True)
    task = cpu.unwrapped.task
    found = [drive_episodes(env, make_policy(name, asked.robots, task), 0) for env in (cpu, warp)]
    for env in (cpu, warp):
        env.close()
    return {"episodes": asked.robots, "cpu": found[0], "warp": found[1]}


def main() -> int:
    """Measure and write `PAGE`; return 1 if anything misses its limit, 3 without a device."""
    parser = argparse.ArgumentParser(prog="parity-gpu", description=__doc__)
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--robots", type=int, default=256, help="at a time, each with one whole episode")
    parser.add_argument("--rays", type=int, default=100_000)
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--contacts", type=int, default=1_000_000)
    parser.add_argument("--env", default="MineXplore/ChileanMineEntrance-v0", help="of the whole episodes")
    parser.add_argument("--policy", nargs="*", default=list(POLICIES), help="of the whole episodes")
    asked = parser.parse_args()
    if asked.robots < 1:
        parser.error(f"--robots {asked.robots}: want 1 or more")
    try:
        asked.env = find_id(asked.env)
        for name in asked.policy:
            make_policy(name, 1, TaskParams())
    except BaselineError as error:
        parser.error(str(error))
    try:
        require_packages()
        device = require_device(asked.device)
    except (ImportError, ValueError) as error:
        print(f"parity-gpu: {error}", file=sys.stderr)
        return _NO_DEVICE
    lines = rows(measure(asked))
    text = tables(lines, device.name if device.is_cuda else "Warp's CPU device", asked.robots, asked.env)
    write_table(PAGE, text)
    print(text, end="")
    return int(not all(row.holds for row in lines))


if __name__ == "__main__":
    sys.exit(main())
