"""Time the environment beside that of another checkout, turn by turn: `python -m benchmarks.speed.two_codes FOLDER`.

Both drive the same commands in the same world. Processor time counts, so that other work on the machine matters less,
and turns alternate, so that it matters to both.

`python benchmarks/speed/two_codes.py --parts WORLD` prints what the parts of one robot's control step take, with the
code that `PYTHONPATH` names.
"""

from __future__ import annotations

import argparse
import functools
import importlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

_ROBOTS, _STEPS, _ALONE_STEPS, _WARM = 64, 30, 400, 2
_CLEARANCE_M = 0.6  # of the places over which robots are spread; the robot's radius is 0.35 m
_START = (
    "import sys, time, gymnasium, minexplore; "
    "gymnasium.make('MineXplore/World-v0', world=sys.argv[1]).reset(seed=0); print(time.process_time())"
)
_UNITS = {
    "one robot": "steps/s",
    "64 robots at the entrance": "steps/s",
    "64 robots spread": "steps/s",
    "import, make, reset": "s",
}


# What is timed by its module and name, each without the others that it calls.
_PARTS = {
    "MuJoCo, 20 steps": "mujoco.batch:Batch.rollout",
    "state to MuJoCo and back": "minexplore.physics.stepper:PhysicsStepper.advance",
    "command to wheels": "minexplore.envs.robot_batch:RobotBatch.drive",
    "places and axes": "minexplore.envs.robot_places:RobotPlaces._stances",
    "beams: directions": "minexplore.envs.robot_batch:RobotBatch._cast",
    "beams: Embree": "minexplore.sensing.lidar:Lidar._hit_faces",
    "beams: floor and nearest": "minexplore.sensing.lidar:Lidar.cast",
    "beams: distances by planes": "minexplore.sensing.lidar:plane_distances",
    "cells that beams cross": "minexplore.envs.robot_batch:RobotBatch._crossed",
    "cells marked": "minexplore.envs.robot_batch:RobotBatch._look",
    "observation": "minexplore.envs.robot_batch:RobotBatch._observe",
    "reward": "minexplore.envs.robot_batch:step_reward",
    "info": "minexplore.envs.robot_batch:RobotBatch._info",
    "checks, counters, end of episode": "minexplore.envs.env:MineEnv.step",
}


class Checkout:
    """Another process that drives with the code of a folder."""

    def __init__(self, root: Path, world: Path) -> None:
        """Start it and let it load what robots reach."""
        self._root, self._world = root, str(world)
        self._environment = {**os.environ, "PYTHONPATH": str(root), "OMP_NUM_THREADS": "1"}
        self._environment.pop("PYTHONDONTWRITEBYTECODE", None)  # a user's second start reads compiled code
        command = [sys.executable, __file__, "--answer", self._world]
        self._driver = subprocess.Popen(
            command, cwd=root, env=self._environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        for _ in range(_WARM):
            self.turn()

    def turn(self) -> dict[str, float]:
        """Return the figures of one turn."""
        assert self._driver.stdin is not None
        assert self._driver.stdout is not None
        self._driver.stdin.write("\n")
        self._driver.stdin.flush()
        rates: dict[str, float] = json.loads(self._driver.stdout.readline())
        started = [sys.executable, "-c", _START, self._world]
        start = subprocess.run(
            started, cwd=self._root, env=self._environment, capture_output=True, text=True, check=True
        )
        return {**rates, "import, make, reset": float(start.stdout)}

    def close(self) -> None:
        """End the process."""
        self._driver.communicate()


def answer(world: str) -> None:
    """Drive a turn for each line of the input, and print its rates."""
    from minexplore.envs.env import MineEnv
    from minexplore.envs.vector import MineVectorEnv

    alone, many = MineEnv(world), MineVectorEnv(_ROBOTS, world)
    places = many.world.places_m(_CLEARANCE_M)
    chosen = places[np.linspace(0, len(places) - 1, _ROBOTS).astype(int)]
    yaws = np.random.default_rng(0).uniform(-np.pi, np.pi, _ROBOTS)
    for _line in sys.stdin:
        alone.reset(seed=0)
        rates = {"one robot": _rate(lambda actions: alone.step(actions[0]), 1, _ALONE_STEPS)}
        many.reset(seed=0)
        rates["64 robots at the entrance"] = _rate(many.step, _ROBOTS, _STEPS)
        many.reset(seed=0)
        for robot, ((x, y), yaw) in enumerate(zip(chosen, yaws, strict=True)):
            many.robots.place(robot, x, y, yaw)
        rates["64 robots spread"] = _rate(many.step, _ROBOTS, _STEPS)
        print(json.dumps(rates), flush=True)


def _rate(step: Callable[[np.ndarray], Any], robots: int, steps: int) -> float:
    """Return control steps a second of processor time, all robots together, of hard driving."""
    rng = np.random.default_rng(0)
    actions = [np.column_stack([rng.uniform(0.3, 1, robots), rng.uniform(-1, 1, robots)]) for _ in range(9)]
    start = time.process_time()
    for k in range(steps):
        step(actions[k // 10 % 9])
    return steps * robots / (time.process_time() - start)


def parts(world: str, repeats: int = 8) -> dict[str, float]:
    """Return what each of `_PARTS` takes, us a control step of one robot: of each step the least of all repeats."""
    from minexplore.envs.env import MineEnv

    spent, inner = dict.fromkeys(_PARTS, 0.0), [0.0]

    def timed(part: str, call: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(call)
        def run(*given: Any, **named: Any) -> Any:
            inner.append(0.0)
            start = time.perf_counter()
            found = call(*given, **named)
            whole = time.perf_counter() - start
            spent[part] += whole - inner.pop()
            inner[-1] += whole
            return found

        return run

    for part, place in _PARTS.items():
        module, _, path = place.partition(":")
        *holder, name = path.split(".")
        where = functools.reduce(getattr, holder, importlib.import_module(module))
        setattr(where, name, timed(part, getattr(where, name)))
    env, rng = MineEnv(world), np.random.default_rng(0)
    actions = [np.array([rng.uniform(0.3, 1), rng.uniform(-1, 1)]) for _ in range(9)]
    taken = np.zeros((repeats, _ALONE_STEPS, len(_PARTS)))
    for steps in taken:
        env.reset(seed=0)
        for k, step in enumerate(steps):
            spent.update(dict.fromkeys(_PARTS, 0.0))
            env.step(actions[k // 10 % 9])
            step[:] = list(spent.values())
    return dict(zip(_PARTS, (1e6 * taken.min(axis=0).mean(axis=0)).tolist(), strict=True))


def rows(before: list[dict[str, float]], after: list[dict[str, float]]) -> list[tuple[str, str, str, str]]:
    """Return a row a figure: its name, the medians of both codes, and the median of the ratios of their turns."""
    found = []
    for name, unit in _UNITS.items():
        old, new = ([turn[name] for turn in turns] for turns in (before, after))
        digits = 2 if unit == "s" else 0
        ratio = median(b / a for a, b in zip(old, new, strict=True))
        medians = (f"{median(side):,.{digits}f}" for side in (old, new))
        found.append((f"{name}, {unit}", *medians, f"{ratio:.2f}"))
    return found  # type: ignore[return-value]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", type=Path, help="folder of another checkout")
    parser.add_argument("--world", type=Path, default=Path("artifacts/realism/world"))
    parser.add_argument("--turns", type=int, default=8)
    given = parser.parse_args()
    from baselines.base.markdown import markdown_table

    roots = given.other.resolve(), Path(__file__).parents[2]
    codes = [Checkout(root, given.world.resolve()) for root in roots]
    turns = [[code.turn() for code in codes] for _ in range(given.turns)]
    for code in codes:
        code.close()
    before, after = ([turn[k] for turn in turns] for k in range(2))
    print(markdown_table(("figure", "other checkout", "this one", "ratio"), rows(before, after)))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--answer"]:
        answer(sys.argv[2])
    elif sys.argv[1:2] == ["--parts"]:
        for name, us in parts(sys.argv[2]).items():
            print(f"{us:6.1f} us  {name}")
    else:
        main()
