"""Time the environment in mines with heights against level mines of the same plan, in turns.

`python -m benchmarks bench-heights` runs it.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

from tqdm import tqdm

from baselines.base.markdown import markdown_table, write_table
from benchmarks.speed.time_env import seconds, steps_per_s
from benchmarks.worlds.small_world import finish_world
from minexplore.envs.env import MineEnv
from minexplore.envs.vector import MineVectorEnv
from pipeline.compose import compose
from pipeline.params.survey import PassageSurveyParams
from pipeline.survey.load import _read
from pipeline.types import Workings
from stages.contours import trace_free_space
from tests.heights import Leg, levels, seam, spiral, table
from tests.volumes import build_volume

TABLE = Path("docs/evidence/parts/levels-speed.md")
_CASES = {"spiral of three turns": spiral(3), "three levels": levels(), "rooms on a dipping seam": seam()}
_ROBOTS, _STEPS, _STEPS_OF_ONE = 64, 40, 200
_LEAST = 0.8


def build_level(legs: dict[str, Leg], folder: Path) -> Path:
    """Build a station table as it is seen from above, as a level mine without tilt; return its bundle."""
    config = compose(["preset=light", "realism.tilt_deg=0"])
    path = folder / "stations.csv"
    path.write_text(table(legs))
    params = PassageSurveyParams(kind="passages", name="level", file="data/x", heights=None)
    read = _read(params.model_copy(update={"file": path.as_posix()}))
    survey = dataclasses.replace(read.survey, heights=None)
    traced = trace_free_space(config.contours, read.plan, survey, Workings(read.workings))
    finish_world(config, survey, traced, folder / "world")
    return folder / "world"


def one_steps_per_s(env: MineEnv, actions: list[list[float]]) -> float:
    """Return the control steps a second of one robot."""

    def drive() -> None:
        for k in range(_STEPS_OF_ONE):
            env.step(actions[k // 10 % len(actions)])  # type: ignore[arg-type]

    return _STEPS_OF_ONE / seconds(drive)


def _from_start(env: Any, rate: Callable[[Any, Any], float], driven: Any) -> float:
    """Return an environment's rate from the start of an episode."""
    env.reset(seed=0)
    return rate(env, driven)


def measure(heights: Path, level: Path, runs: int) -> dict[str, tuple[float, float, float]]:
    """Return steps a second with heights and on the level, and the median of their ratios, by environment."""
    actions = [[1.0, 0.6], [0.7, -1.0], [0.9, 0.2], [1.0, -0.4]]
    many = [MineVectorEnv(_ROBOTS, world) for world in (heights, level)]
    alone = [MineEnv(world) for world in (heights, level)]
    rows: dict[str, list[list[float]]] = {"vector": [], "one robot": []}
    for _ in range(runs + 1):
        rows["vector"].append([_from_start(env, steps_per_s, _STEPS) for env in many])
        rows["one robot"].append([_from_start(env, one_steps_per_s, actions) for env in alone])
    for env in many:
        env.close()
    for one in alone:
        one.close()
    rows = {name: pairs[1:] for name, pairs in rows.items()}  # the first made models and scenes
    return {
        name: (median(o for o, _ in pairs), median(t for _, t in pairs), median(o / t for o, t in pairs))
        for name, pairs in rows.items()
    }


def main() -> int:
    """Measure, print, write; exit code 2 if a ratio is below its limit."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=9)
    arguments = parser.parse_args()
    rows: list[tuple[str, ...]] = []
    lowest = 1.0
    for name, legs in tqdm(_CASES.items(), unit="mine", disable=None):
        with tempfile.TemporaryDirectory() as folder:
            places = [Path(folder) / kind for kind in ("heights", "level")]
            for place in places:
                place.mkdir()
            mine, level = build_volume(table(legs), places[0]), build_level(legs, places[1])
            found = measure(mine, level, arguments.runs)
        for kind, (ours, theirs, ratio) in found.items():
            robots = f"{_ROBOTS} robots" if kind == "vector" else kind
            rows.append((name, robots, f"{ours:,.0f}", f"{theirs:,.0f}", f"{ratio:.2f}", f">= {_LEAST:g}"))
            lowest = min(lowest, ratio)
    table_text = markdown_table(("mine", "environment", "with heights", "level", "ratio", "limit"), rows)
    write_table(TABLE, f"Measured on {os.cpu_count()} cores, {arguments.runs} runs.\n\n{table_text}")
    print(table_text, end="")
    if lowest < _LEAST:
        print(f"bench-heights: a ratio is below {_LEAST:g}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
