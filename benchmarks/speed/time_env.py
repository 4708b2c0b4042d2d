"""Time the environment against its references, each ratio within one run, and write `artifacts/bench/env.json`."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median

import mujoco
import numpy as np
from tqdm import tqdm

from baselines.base.markdown import markdown_table, write_table
from benchmarks.results import run_benchmark
from benchmarks.speed.plain_env import PlainEnv
from minexplore.bundle import MINE_BODY, floor_geom
from minexplore.envs.env import MineEnv
from minexplore.envs.vector import MineVectorEnv
from minexplore.physics.local_models import LocalModels
from minexplore.physics.robot import (
    ROCK_BODY,
    RobotParams,
    attach_robot,
    contact_sensor,
    free_joint_qpos,
    separate_contacts,
)
from minexplore.task import TaskParams
from minexplore.world import World, find_world, load_world
from pipeline.store.files import write_atomically

RESULTS, TABLE = Path("artifacts/bench/env.json"), Path("docs/evidence/parts/env-speed.md")
_RUNS, _ROBOTS, _STEPS, _ALONE_STEPS = 5, 64, 60, 400
_CLEARANCE_M = 0.6  # of the places over which robots are spread; the robot's radius is 0.35 m
_LIMITS = {
    "physics_vs_bare_floor": (0.95, None),
    "vector_vs_plain": (5.0, None),
    "two_threads_vs_one": (1.5, None),
    "reset_ms": (None, 1.0),
    "make_vec_256_s": (None, 2.0),
    "make_vec_256_mb": (None, 1000),
}
_MAKE = """
import time
start = time.perf_counter()
import gymnasium, minexplore
env = gymnasium.make_vec("MineXplore/ChileanMine-v0", num_envs=256, vectorization_mode="vector_entry_point")
env.reset(seed=0)
peak = [line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")][0]
print(time.perf_counter() - start, int(peak) / 1000)
"""


def seconds(work: Callable[[], object]) -> float:
    """Return how long a call takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def physics_ratios(world: World) -> tuple[float, float]:
    """Return the local models' physics rate over that on a bare floor, with the mine's dip and level, one thread.

    Robots drive at stations spread over the mine. On a slope more wheels and castors bear, whatever stands around.
    """
    task, robot = TaskParams(), RobotParams()
    local_models = LocalModels(world, task, robot)
    row, col = np.nonzero(world.clearance_m >= 1.0)
    pick = np.linspace(0, len(row) - 1, 12).astype(int)
    places = world.origin_m + (np.column_stack([col[pick], row[pick]]) + 0.5) * world.cell_m
    models = [local_models.model(tuple(t)) for t in local_models.tiles_of(places).tolist()]
    dipping, level = (bare_floor(task, robot, T) for T in (local_models.T_world_mine, np.eye(4)))

    def drive(model: mujoco.MjModel, pose: np.ndarray) -> None:
        data = mujoco.MjData(model)
        data.qpos[:7] = pose
        data.ctrl[:] = [1.0, 1.2]
        mujoco.mj_step(model, data, 1000)

    poses = [free_joint_qpos(local_models.T_world_mine, robot, x, y, 0.3) for x, y in places]
    flat = free_joint_qpos(np.eye(4), robot, 0.0, 0.0, 0.3)
    ours = sum(seconds(partial(drive, model, pose)) for model, pose in zip(models, poses, strict=True))
    on_dip = sum(seconds(partial(drive, dipping, pose)) for pose in poses)
    on_level = sum(seconds(partial(drive, level, flat)) for _ in poses)
    return on_dip / ours, on_level / ours


def bare_floor(task: TaskParams, robot: RobotParams, T_world_mine: np.ndarray) -> mujoco.MjModel:
    """Return the physics model of a robot on a floor without rock."""
    spec = mujoco.MjSpec()
    spec.option.timestep = task.physics_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, T_world_mine[:3, :3].ravel())
    mine = spec.worldbody.add_body(name=MINE_BODY, pos=T_world_mine[:3, 3], quat=quat)
    mine.add_geom(
        name=floor_geom("dry"), type=mujoco.mjtGeom.mjGEOM_BOX, size=[800, 400, 0.25], pos=[0, 0, -0.25], priority=1
    )
    spec.worldbody.add_body(name=ROCK_BODY)
    separate_contacts(spec)
    attach_robot(spec, "robot", robot)
    contact_sensor(spec, "robot")
    return spec.compile()


def steps_per_s(env: MineVectorEnv, steps: int) -> float:
    """Return control steps a second, all robots together, of hard driving."""
    rng = np.random.default_rng(0)
    actions = [np.column_stack([rng.uniform(0.3, 1, env.num_envs), rng.uniform(-1, 1, env.num_envs)]) for _ in range(9)]
    return steps * env.num_envs / seconds(lambda: [env.step(actions[k // 10 % 9]) for k in range(steps)])


def start_at_entrance(env: MineVectorEnv) -> None:
    """Reset all robots: every one starts at the same place."""
    env.reset(seed=0)


def start_spread(env: MineVectorEnv) -> None:
    """Reset all robots and place them evenly over the mine, each with a heading of its own."""
    env.reset(seed=0)
    places = env.world.places_m(_CLEARANCE_M)
    chosen = places[np.linspace(0, len(places) - 1, env.num_envs).astype(int)]
    yaws = np.random.default_rng(0).uniform(-np.pi, np.pi, env.num_envs)
    for robot, ((x, y), yaw) in enumerate(zip(chosen, yaws, strict=True)):
        env.robots.place(robot, x, y, yaw)


def paired_steps_per_s(
    envs: tuple[MineVectorEnv, ...], start: Callable[[MineVectorEnv], None], steps: int
) -> list[float]:
    """Return the rates of environments over the same steps from the same start, one after the other."""
    rates = []
    for env in envs:
        start(env)
        rates.append(steps_per_s(env, steps))
    return rates


def one_robot_steps_per_s(env: PlainEnv | MineEnv, steps: int) -> float:
    """Return the control steps a second of an environment of one robot."""
    rng = np.random.default_rng(0)
    actions = [np.array([rng.uniform(0.3, 1), rng.uniform(-1, 1)]) for _ in range(9)]
    env.reset()
    return steps / seconds(lambda: [env.step(actions[k // 10 % 9]) for k in range(steps)])


def measure() -> dict[str, float]:
    """Measure every figure: the median of five runs, references in the same run."""
    folder = find_world("chilean_mine")
    world = load_world(folder)
    plain, alone = PlainEnv(world), MineEnv(folder)
    one_robot_steps_per_s(alone, _ALONE_STEPS)
    one, two = (MineVectorEnv(_ROBOTS, folder, threads=t) for t in (1, 2))
    for start in (start_spread, start_at_entrance):  # models and scenes are made as robots reach them
        paired_steps_per_s((one, two), start, _STEPS)
    runs = [
        {
            **_vector_rates(one, two, plain),
            "one_robot_steps_per_s": one_robot_steps_per_s(alone, _ALONE_STEPS),
            **dict(zip(("physics_vs_dipping_floor", "physics_vs_bare_floor"), physics_ratios(world), strict=True)),
            "reset_ms": 1000 * seconds(lambda: [one.reset() for _ in range(20)]) / 20 / _ROBOTS,
            **_making(),
        }
        for _ in tqdm(range(_RUNS), desc="runs", disable=None)
    ]
    return {name: round(median(run[name] for run in runs), 3) for name in runs[0]}


def _vector_rates(one: MineVectorEnv, two: MineVectorEnv, plain: PlainEnv) -> dict[str, float]:
    """Return steps/s and their ratios: robots spread over the mine, then all at the entrance as the references."""
    spread, spread_two = paired_steps_per_s((one, two), start_spread, _STEPS)
    together, together_two = paired_steps_per_s((one, two), start_at_entrance, _STEPS)
    theirs = one_robot_steps_per_s(plain, _STEPS)
    return {
        "vector_steps_per_s": spread,
        "two_threads_steps_per_s": spread_two,
        "two_threads_vs_one": spread_two / spread,
        "entrance_steps_per_s": together,
        "entrance_two_threads_vs_one": together_two / together,
        "plain_steps_per_s": theirs,
        "vector_vs_plain": together / theirs,
    }


def _making() -> dict[str, float]:
    made = subprocess.run([sys.executable, "-c", _MAKE], capture_output=True, text=True, check=True).stdout.split()
    return {"make_vec_256_s": float(made[0]), "make_vec_256_mb": float(made[1])}


def tables(figures: dict[str, float], load: float) -> tuple[str, list[str]]:
    """Return the table, and the names of the figures beyond their limits."""
    rows, missed = [], []
    for name, value in figures.items():
        low, high = _LIMITS.get(name, (None, None))
        limit = f">= {low:g}" if low is not None else f"<= {high:g}" if high is not None else ""
        if (low is not None and value < low) or (high is not None and value > high):
            missed.append(name)
            limit += " (missed)"
        rows.append((name, f"{value:,.2f}", limit))
    table = markdown_table(("figure", "measured", "limit"), rows)
    other = f"Other work on the machine before the start: a load average of {load:.1f}."
    return f"Measured on {os.cpu_count()} cores. {other}\n\n{table}", missed


def main() -> int:
    """Measure, print, write; exit code 2 if a figure misses its limit."""
    load = os.getloadavg()[0]
    figures = measure()
    write_atomically(RESULTS, (json.dumps(figures, indent=2) + "\n").encode())
    text, missed = tables(figures, load)
    write_table(TABLE, text)
    print(text, end="")
    if missed:
        print(f"bench: beyond the limit: {', '.join(missed)}", file=sys.stderr)
    return 2 if missed else 0


if __name__ == "__main__":
    sys.exit(run_benchmark("bench", main))
