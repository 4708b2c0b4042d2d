"""Time the environment on a GPU beside the robot on a bare floor and the CPU's environment.

`python -m benchmarks bench-gpu` runs it.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from baselines.base.markdown import markdown_table, write_table
from benchmarks.speed.time_env import bare_floor, steps_per_s
from minexplore.envs.vector import MineVectorEnv
from minexplore.extra.warp import require_device, require_packages
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from minexplore.world import World, find_world, load_world

TABLE = Path("docs/evidence/parts/env-speed-gpu.md")
COUNTS = (1024, 4096, 16_384, 65_536, 131_072)
_MEMORY_AT = 65_536  # robots
_LIMITS = {
    "control steps/s, all on the device": ("steps_per_s", 1_000_000, None),
    "of the bare floor in the same run": ("of_bare_floor", 0.6, None),
    "rays/s of the beams alone": ("rays_per_s", 300_000_000, None),
    f"GB of device memory at {_MEMORY_AT:,} robots": ("memory_gb", None, 40.0),
}
_NO_DEVICE = 3  # exit code


class DeviceBench:
    """Timed pieces of a control step of n robots that drive at random places of a mine."""

    def __init__(self, world: World, count: int, device: str) -> None:
        """Scatter the robots and drive them for a second."""
        from minexplore.extra.warp.batch import WarpBatch

        self.count, self.device = count, require_device(device)
        self._before = self._used_bytes()
        self.batch = WarpBatch(world, TaskParams(), RobotParams(), count, self.device)
        rng = np.random.default_rng(0)
        places = world.places_m(0.6)
        self.batch.arrays["drives"].fill_(True)
        qpos = _poses(self.batch.models.T_world_mine, places[rng.integers(len(places), size=count)], rng)
        zero = np.zeros((count, self.batch.physics.host_model.nv))
        self.batch.physics.set_state(np.column_stack([qpos, np.zeros((count, 2))]), zero, zero)
        action = np.column_stack([rng.uniform(0.3, 1, count), rng.uniform(-1, 1, count)]).astype(np.float32)
        self.batch.arrays["action"].assign(action)
        for _ in range(10):
            self.batch.step()

    def _used_bytes(self) -> int:
        if not self.device.is_cuda:
            return 0
        import torch

        torch.cuda.synchronize()
        free, total = torch.cuda.mem_get_info(torch.device(str(self.device)))
        return total - free

    def seconds(self, work: Callable[[], None], runs: int) -> float:
        """Return how long one of `runs` calls takes on the device."""
        import warp as wp

        work()
        work()  # recorded by the second call
        wp.synchronize_device(self.device)
        start = time.perf_counter()
        for _ in range(runs):
            work()
        wp.synchronize_device(self.device)
        return (time.perf_counter() - start) / runs

    def measure(self, runs: int) -> dict[str, float]:
        """Return the rates of a step with and without beams, the shares of its parts, and the memory in use."""
        from minexplore.extra.warp.graph import Replayed

        batch, physics, a = self.batch, self.batch.physics, self.batch.arrays
        pieces = {
            "slots": lambda: physics.fill_slots(a["fault"]),
            "physics": lambda: physics.advance(batch.task.substeps, a["touched"]),
            "rays": lambda: batch.cast("drives"),
            "coverage": lambda: batch.mark("drives"),
        }
        whole_s = self.seconds(batch.step, runs)
        memory = self._used_bytes() - self._before  # what follows records graphs of its own
        blind_s = self.seconds(Replayed(self.device, batch.drive), runs)
        parts_s = {name: self.seconds(Replayed(self.device, piece), runs) for name, piece in pieces.items()}
        beams = batch.task.beams * self.count
        return {
            "steps_per_s": self.count / whole_s,
            "steps_per_s_without_rays": self.count / blind_s,
            "rays_per_s": beams / parts_s["rays"],
            **{f"share_{name}": part / whole_s for name, part in parts_s.items()},
            "share_rest": 1 - sum(parts_s.values()) / whole_s,
            "memory_gb": memory / 1e9,
            "overflows": int(np.count_nonzero(physics.overflows())),
            "faults": int(np.count_nonzero(a["fault"].numpy())),
        }

    def bare_floor(self, runs: int) -> float:
        """Return the control steps/s of as many robots on a bare floor with the mine's dip: physics alone."""
        import mujoco_warp as mjw
        import warp as wp

        from minexplore.extra.warp.graph import Replayed
        from minexplore.extra.warp.physics import put_model

        task = TaskParams()
        model = bare_floor(task, RobotParams(), self.batch.models.T_world_mine)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR
        model.opt.iterations = self.batch.physics.host_model.opt.iterations
        with wp.ScopedDevice(self.device):
            on_device = put_model(model)
            data = mjw.make_data(model, nworld=self.count, nconmax=8, nccdmax=1, njmax=32)
            data.ctrl.fill_(5.0)

        def drive() -> None:
            for _ in range(task.substeps):
                mjw.step(on_device, data)

        return self.count / self.seconds(Replayed(self.device, drive), runs)


def _poses(T_world_mine: np.ndarray, places: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    from minexplore.physics.robot import free_joint_qpos

    yaws = rng.uniform(-np.pi, np.pi, len(places))
    return np.stack(
        [free_joint_qpos(T_world_mine, RobotParams(), x, y, yaw) for (x, y), yaw in zip(places, yaws, strict=True)]
    )


def measure(device: str, counts: list[int], runs: int) -> dict[str, Any]:
    """Measure the CPU's vector environment and then every count."""
    threads = os.cpu_count() or 1
    found: dict[str, Any] = {"device": _name(device), "cpu_threads": threads}
    found |= {"cpu_steps_per_s": _cpu_steps_per_s(threads), "rows": []}
    for count in counts:
        # A process frees all of the device's memory when it ends; Warp keeps that of its recorded graphs.
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
            found["rows"].append(process.submit(measure_count, device, count, runs).result())
        print(json.dumps(found["rows"][-1]), flush=True)
    return found


def _cpu_steps_per_s(threads: int) -> float:
    env = MineVectorEnv(64 * threads, find_world("chilean_mine"), threads=threads)
    env.reset(seed=0)
    steps_per_s(env, 10)
    return float(f"{steps_per_s(env, 20):.4g}")


def measure_count(device: str, count: int, runs: int) -> dict[str, float]:
    """Measure so many robots, with four digits."""
    bench = DeviceBench(load_world(find_world("chilean_mine")), count, device)
    row = {**bench.measure(runs), "bare_floor_steps_per_s": bench.bare_floor(runs)}
    row["of_bare_floor"] = row["steps_per_s"] / row["bare_floor_steps_per_s"]
    return {"robots": count, **{name: float(f"{value:.4g}") for name, value in row.items()}}


def _name(device: str) -> str:
    found = require_device(device)
    return found.name if found.is_cuda else "CPU"


def table(found: dict[str, Any]) -> str:
    """Return the tables of the figures."""
    best = max(found["rows"], key=lambda row: row["steps_per_s"])
    at = {int(row["robots"]): row for row in found["rows"]}
    limited = []
    for title, (name, low, high) in _LIMITS.items():
        row = at.get(_MEMORY_AT) if name == "memory_gb" else best
        measured = "open" if row is None else _digits(row[name])
        limit = f">= {low:,g}" if low is not None else f"<= {high:,g}"
        missed = row is not None and not (low or -np.inf) <= row[name] <= (high or np.inf)
        limited.append((title, measured, limit + ": **missed**" * missed))
    rows = (list(map(_digits, row.values())) for row in found["rows"])
    return (
        f"Measured on one {found['device']}. The CPU's vector environment makes {found['cpu_steps_per_s']:,.0f} "
        f"control steps/s there with {found['cpu_threads']} threads.\n\n"
        f"{markdown_table(('figure', 'measured', 'limit'), limited)}\n{markdown_table(found['rows'][0], rows)}"
    )


def _digits(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.4g}"


def main() -> int:
    """Measure and, on a GPU, write `TABLE`; without a device write nothing and return 3."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--robots", type=int, nargs="+", default=list(COUNTS))
    parser.add_argument("--runs", type=int, default=20)
    asked = parser.parse_args()
    try:
        require_packages()
        device = require_device(asked.device)
    except (ImportError, ValueError) as error:
        print(f"bench-gpu: nothing measured: {error}", file=sys.stderr)
        return _NO_DEVICE
    text = table(measure(asked.device, asked.robots, asked.runs))
    if device.is_cuda:
        write_table(TABLE, text)
    print(text, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
