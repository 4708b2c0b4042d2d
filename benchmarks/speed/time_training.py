"""Time PPO training on the entrance variant: environment steps per second, sampling and updates included."""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from baselines.base.errors import need
from baselines.ppo.settings import compose_settings
from benchmarks.resume import run_benchmark
from pipeline.store.files import write_atomically

RESULTS = Path("artifacts/bench/training.json")
_PAPER = 520  # environment steps/s in the authors' log
_WARM, _TIMED = 2, 12  # iterations


def time_training(overrides: list[str]) -> dict[str, Any]:
    """Train for some iterations and return the median and quartiles of steps/s after the warm-up."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    try:
        import ray
        import torch

        from baselines.ppo.algorithm import build_algorithm
    except ImportError as error:
        raise need(str(error.name)) from error
    torch.set_num_threads(int(os.environ["OMP_NUM_THREADS"]))
    settings = compose_settings(overrides)
    ray.init(include_dashboard=False, logging_level="ERROR", runtime_env={"env_vars": {"PYTHONPATH": str(Path.cwd())}})
    algorithm = build_algorithm(settings, 0)
    speeds = []
    for _ in range(_WARM + _TIMED):
        start = time.perf_counter()
        result = algorithm.train()
        speeds.append(result["env_runners"]["num_env_steps_sampled"] / (time.perf_counter() - start))
    algorithm.stop()
    ray.shutdown()
    low, middle, high = np.quantile(speeds[_WARM:], [0.25, 0.5, 0.75])
    return {
        "overrides": overrides,
        "steps_per_s": round(float(middle)),
        "quarters": [round(float(low)), round(float(high))],
        "paper": _PAPER,
        "ratio": round(float(middle) / _PAPER, 2),
        "cores": os.cpu_count(),
    }


def main() -> int:
    """Time the overrides on the command line, which are those of `baselines.ppo.train`."""
    timing = time_training(sys.argv[1:])
    write_atomically(RESULTS, (json.dumps(timing, indent=1) + "\n").encode())
    low, high = timing["quarters"]
    print(
        f"{timing['steps_per_s']:,} environment steps/s with updates ({low:,} to {high:,}), "
        f"{timing['ratio']} times the paper's {_PAPER}, {timing['cores']} cores"
    )
    return 0


if __name__ == "__main__":
    sys.exit(run_benchmark("time-training", main))
