"""What `two_codes` measures in a process of its own, with the code that `PYTHONPATH` names: `one_code.py PART...`.

It prints a line of JSON: the file of the package that was imported, and figures by name, seconds as a pair of processor
and wall. Nothing is imported before a part asks for it, and both codes must have what a part uses.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

DEFAULT, OWN, ANT = "MineXplore/ChileanMine-v0", "MineXplore/World-v0", "Ant-v5"
_ROBOTS, _ROUNDS, _STEPS, _SUBSTEPS = 64, 4, 36, 20
_ALONE_STEPS, _BARE_STEPS = 250, 1200
_CLEARANCE_M = 0.6  # of places; the robot's radius is 0.35 m
_MEMORY_STEPS = 360
Figures = dict[str, Any]


def _timed(work: Callable[[], object]) -> list[float]:
    start = time.process_time(), time.perf_counter()
    work()
    return [time.process_time() - start[0], time.perf_counter() - start[1]]


def _made(world: str, robots: int) -> Any:
    """Return the environment of one robot, or of many, in the default or in a bundle."""
    import gymnasium

    import minexplore  # noqa: F401

    given: dict[str, Any] = {} if world == DEFAULT else {"world": world}
    env_id = DEFAULT if world == DEFAULT else OWN
    if robots == 1:
        return gymnasium.make(env_id, **given).unwrapped
    many = gymnasium.make_vec(env_id, num_envs=robots, vectorization_mode="vector_entry_point", **given)
    return many.unwrapped


def _places(env: Any) -> Any:
    """Return the places (n, 2 or 3) m of a clearance, which a robot reaches in a volume."""
    if env.world.volume is None:
        return env.world.places_m(_CLEARANCE_M)
    spans = env.world.volume.spans
    return spans.places_m[env.robots.ground._standing & (spans.clearance_m >= _CLEARANCE_M)]


def _place(env: Any, rng: Any, is_anew: bool) -> None:
    """Reset and place all robots, evenly or anywhere, each with a heading of its own."""
    import numpy as np

    env.reset(seed=0)
    places = _places(env)
    even = np.linspace(0, len(places) - 1, _ROBOTS).astype(int)
    chosen = rng.choice(len(places), _ROBOTS, replace=False) if is_anew else even
    for robot, (x, y, *z) in enumerate(places[chosen].tolist()):
        env.robots.place(robot, x, y, rng.uniform(-3.14, 3.14), *z)


def _commands(rng: Any, robots: int) -> Any:
    import numpy as np

    return np.column_stack([rng.uniform(0.3, 1, robots), rng.uniform(-1, 1, robots)])


def _drive(env: Any, robots: int, steps: int, rng: Any) -> list[float]:
    """Drive hard; return seconds a control step of a robot."""
    actions = [_commands(rng, robots) for _ in range(steps // 10 + 1)]
    if robots == 1:
        actions = [action[0] for action in actions]
    spent = _timed(lambda: [env.step(actions[k // 10]) for k in range(steps)])
    return [s / (steps * robots) for s in spent]


def steps(pell: str) -> Figures:
    """Return seconds of a robot's step: the bare robot on a plane, one robot and 64 in the default and in Wheal Pell.

    Each round resets one robot with a seed of its own, and places the 64 anew and then evenly at the same places; the
    first does not count.
    """
    import mujoco
    import numpy as np

    from benchmarks.speed.time_env import bare_floor
    from minexplore.physics.robot import RobotParams, free_joint_qpos
    from minexplore.task import TaskParams

    rng = np.random.default_rng(0)
    task, robot = TaskParams(), RobotParams()
    model = bare_floor(task, robot, np.eye(4))

    def bare() -> list[float]:
        data = mujoco.MjData(model)
        data.qpos[:7] = free_joint_qpos(np.eye(4), robot, 0.0, 0.0, 0.3)
        data.ctrl[:] = [1.0, 1.2]
        spent = _timed(lambda: [mujoco.mj_step(model, data, _SUBSTEPS) for _ in range(_BARE_STEPS)])
        return [s / _BARE_STEPS for s in spent]

    worlds = {"default": DEFAULT, "pell": pell}
    envs = {name: (_made(world, 1), _made(world, _ROBOTS)) for name, world in worlds.items()}
    rounds: list[Figures] = []
    for number in range(_ROUNDS):
        found: Figures = {"bare": bare()}
        for name, (alone, many) in envs.items():
            alone.reset(seed=number)
            found[f"one, {name}"] = _drive(alone, 1, _ALONE_STEPS, rng)
            for start in ("anew", "spread"):
                _place(many, rng, start == "anew")
                found[f"{start}, {name}"] = _drive(many, _ROBOTS, _STEPS, rng)
        rounds.append(found)
    return {name: np.mean([found[name] for found in rounds[1:]], axis=0).tolist() for name in rounds[0]}


def _peak_mb() -> float:
    return int(Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0]) * 1024 / 1e6


def memory(world: str, more: str = "0") -> Figures:
    """Return the largest memory, MB, after 360 steps and after `more`: of 64 robots spread over the default, or Ant."""
    import gymnasium
    import numpy as np

    rng, found, done = np.random.default_rng(0), {}, 0
    if world == ANT:
        env: Any = gymnasium.make(ANT)
        env.reset(seed=0)
    else:
        env = _made(DEFAULT, _ROBOTS)
        _place(env, rng, False)
    action = _commands(rng, _ROBOTS)
    for count in sorted({_MEMORY_STEPS, max(_MEMORY_STEPS, int(more))}):
        for k in range(done, count):
            if world != ANT:
                action = _commands(rng, _ROBOTS) if k % 10 == 0 else action
                env.step(action)
            elif any(env.step(rng.uniform(-1, 1, 8))[2:4]):
                env.reset()
        done = count
        found[f"memory, {world}, {count}"] = _peak_mb()
    return found


def start(world: str) -> Figures:
    """Import, make and reset; the process itself is timed."""
    import gymnasium

    if world != ANT:
        import minexplore  # noqa: F401
    given: dict[str, Any] = {} if world in (ANT, DEFAULT) else {"world": world}
    gymnasium.make(world if not given else OWN, **given).reset(seed=0)
    return {}


def frame() -> Figures:
    """Return seconds of a frame of the camera of 320 x 240 pixels, the median of some, with the step to the next."""
    import os

    os.environ["MUJOCO_GL"] = "osmesa"
    import gymnasium
    import numpy as np

    import minexplore  # noqa: F401

    env = gymnasium.make(DEFAULT, sensors=("rgb",))
    env.reset(seed=0)
    frames = [_timed(lambda: env.step(np.array([0.8, 0.2]))) for _ in range(6)]
    return {"frame": np.median(frames[1:], axis=0).tolist()}


def load(bundle: str) -> Figures:
    """Return the first load of a bundle's model by MuJoCo: seconds and the largest memory, MB."""
    import mujoco

    spent = _timed(lambda: mujoco.MjModel.from_xml_path(f"{bundle}/mine.xml"))
    return {"load": spent, "load, memory": _peak_mb()}


def build(root: str) -> Figures:
    """Build the default world into a folder."""
    from pipeline.build.world import make_world
    from pipeline.compose import compose

    make_world(compose([]), Path(root))
    return {}


PARTS: dict[str, Callable[..., Figures]] = {part.__name__: part for part in (steps, memory, start, frame, load, build)}

if __name__ == "__main__":
    figures = PARTS[sys.argv[1]](*sys.argv[2:])
    package = sys.modules.get("minexplore")
    print(json.dumps({"file": package and package.__file__, **figures}))
