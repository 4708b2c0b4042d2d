"""What each stage of a world costs: processor time and memory, each stage and the environment in its own process."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

STAGES = ("survey", "contours", "compile3d", "surface", "realism", "validation")
_ROBOTS, _STEPS, _RUNS = 16, 60, 3


@dataclass(frozen=True)
class Costs:
    """`stages_s` are processor seconds, `peak_mb` the largest memory of a stage's process or of its reader's."""

    stages_s: dict[str, float]
    peak_mb: dict[str, float]
    load_s: float
    env_peak_mb: float
    steps_per_s: float
    reset_ms: float


def measure(overrides: list[str], root: Path, project: Path = Path()) -> Costs:
    """Build a world, each stage in a process of its own, and drive in it.

    Parameters
    ----------
    overrides : list of str
        Hydra overrides that make the world.
    root : Path
        Its folder. A mine's file needs one below the project.
    project : Path
        Where the commands run.

    Raises
    ------
    RuntimeError
        If a stage fails; the message names it.
    """
    stages = {name: _run(project, "stage", name, str(root), *overrides) for name in STAGES}
    driven = _run(project, "drive", str(root))
    return Costs(
        stages_s={name: run["s"] for name, run in stages.items()},
        peak_mb={name: run["mb"] for name, run in stages.items()},
        load_s=driven["load_s"],
        env_peak_mb=driven["mb"],
        steps_per_s=driven["steps_per_s"],
        reset_ms=driven["reset_ms"],
    )


def build_stage(name: str, overrides: list[str], root: Path) -> dict[str, float]:
    """Run one stage in this process; return its processor seconds and its largest memory, MB.

    Stage 1 reads a mine's file in a child: its time is added, and its memory counts where it is the larger one.
    """
    from pipeline.compose import compose
    from pipeline.errors import LimitError
    from pipeline.stage import make_artifacts
    from stages.__main__ import load_stages

    stage = next(stage for stage in load_stages() if stage.name == name)
    params = getattr(compose(overrides), name)
    start = _processor_s()
    try:
        make_artifacts(stage, params, root)
    except LimitError as error:  # the artifacts are written, and say so
        print(error, file=sys.stderr)
    return {"s": round(_processor_s() - start, 2), "mb": _peak_mb()}


def drive(root: Path) -> dict[str, float]:
    """Load a world's environment in this process and drive; return the time to make it, its rate and its memory."""
    from minexplore.envs.vector import MineVectorEnv

    start = time.process_time()
    env = MineVectorEnv(_ROBOTS, root / "realism" / "world", threads=1)
    env.reset(seed=0)
    made = time.process_time() - start
    rng = np.random.default_rng(0)
    actions = [np.column_stack([rng.uniform(0.3, 1, _ROBOTS), rng.uniform(-1, 1, _ROBOTS)]) for _ in range(9)]

    def steps() -> float:
        start = time.process_time()
        for k in range(_STEPS):
            env.step(actions[k // 10 % 9])
        return _STEPS * _ROBOTS / (time.process_time() - start)

    def resets() -> float:
        start = time.process_time()
        for _ in range(20):
            env.reset()
        return 1000 * (time.process_time() - start) / 20 / _ROBOTS

    steps()  # models and scenes are made as robots reach them
    rates, times = [], []
    for _ in range(_RUNS):
        env.reset(seed=0)
        rates.append(steps())
        times.append(resets())
    return {
        "load_s": round(made, 3),
        "steps_per_s": round(float(np.median(rates)), 1),
        "reset_ms": round(float(np.median(times)), 4),
        "mb": _peak_mb(),
    }


def _run(project: Path, *what: str) -> dict[str, Any]:
    """Do one thing in a fresh process, whose largest memory is then that of the thing."""
    command = [sys.executable, "-m", "benchmarks.speed.stage_costs", *what]
    done = subprocess.run(command, cwd=project, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0 or not done.stdout.strip():
        raise RuntimeError(f"{' '.join(what)} ended with code {done.returncode}")
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def _processor_s() -> float:
    """Return the processor time of this process and of its ended children, s."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def _peak_mb() -> float:
    """Return the largest memory of this process, or of one of its ended children, MB."""
    own_kb = int(Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0])
    return round(max(own_kb, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss) * 1024 / 1e6, 1)


def main() -> int:
    """Print the figures of one stage, `stage NAME ROOT OVERRIDE...`, or of the environment, `drive ROOT`, as JSON."""
    what, *rest = sys.argv[1:]
    found = drive(Path(rest[0])) if what == "drive" else build_stage(rest[0], rest[2:], Path(rest[1]))
    print(json.dumps(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
