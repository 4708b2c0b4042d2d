"""`python -m minexplore list | play ID | record ID | time ID | page`: see, drive, record and time what there is."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from itertools import chain, count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gymnasium
import numpy as np

from minexplore import ENTRY_POINT, FAMILY, environments
from minexplore.bundle import BundleError, is_volume
from minexplore.ends import run_command
from minexplore.envs.env import MineEnv
from minexplore.extra.record.command import add_arguments, check_least, given_of, record
from minexplore.extra.record.policies import spread_command
from minexplore.page import page
from minexplore.physics.robots import ROBOTS
from minexplore.pictures.opengl import DisplayError
from minexplore.world import find_world, load_world

_KEYS = {265: (0.2, 0.0), 264: (-0.2, 0.0), 263: (0.0, 0.25), 262: (0.0, -0.25)}  # GLFW's arrow keys
_ID = "as `list` names them, that of a built mine of a family, or NAME for MineXplore/NAME-v0; GoTo-NAME has a goal"
_A_MINE = "MineXplore/Family-test-0007-v0"
Policy = Callable[[np.ndarray], np.ndarray]


def list_envs() -> None:
    """List the environments and their worlds, those of own mines too."""
    for env_id, kwargs in environments().items():
        name = kwargs.get("world")
        if name is None:
            print(f"{env_id:36} any bundle: world=FOLDER")
            continue
        try:
            record = load_world(find_world(name)).record
        except (BundleError, FileNotFoundError) as error:
            print(f"{env_id:36} {error}")
            continue
        changes = {**kwargs.get("task", {}), **{k: v for k, v in kwargs.items() if k == "robot"}}
        task = ", ".join(f"{k}={v}" for k, v in changes.items()) or "as published"
        area = f"{record['areas']['tunnel_m2']:,.0f} m2{' in plan' if is_volume(record) else ''}"
        print(f"{env_id:36} {record['name']}, {area}, {record['drifts']} drifts, {record['world_sha256'][:12]}; {task}")


def ahead(observation: np.ndarray, beams: int) -> np.ndarray:
    """Drive towards where the beams in the robot's plane, the first ones, reach farthest ahead, slower before walls."""
    angle = (np.arange(beams) * 2 * np.pi / beams + np.pi) % (2 * np.pi) - np.pi
    front = np.abs(angle) < 1.2
    ranges = observation[:beams]
    turn = float(np.average(angle[front], weights=ranges[front] ** 3 + 1e-6))
    nearest = float(ranges[np.abs(angle) < 0.6].min())
    return np.array([np.clip(4 * nearest, 0.05, 1.0), np.clip(1.5 * turn, -1, 1)], dtype=np.float32)


def play(env_id: str, kwargs: dict[str, Any], policy: str, steps: int, video: str | None) -> None:
    """Drive by the arrow keys in MuJoCo's viewer, or let a policy drive; `--video FOLDER` records without a screen."""
    if video and policy == "keyboard":
        raise ValueError("policy = 'keyboard': --video has no screen to take keys from; want ahead or random")
    env = gymnasium.make(env_id, render_mode="rgb_array" if video else "human", **kwargs)
    if not video:
        _drive(env, policy, steps, True)
        return
    try:
        Path(video).mkdir(parents=True, exist_ok=True)
        recording = TemporaryDirectory(prefix=".recording-", dir=video)
    except OSError as error:
        raise ValueError(f"video = {video!r}: no folder that can be written ({error.strerror})") from error
    with recording as place:  # nothing is kept of a video that is not finished
        own = Path(place, "made")  # a folder that is there is warned of
        _drive(gymnasium.wrappers.RecordVideo(env, str(own), episode_trigger=lambda k: True), policy, steps, False)
        for file in sorted(own.glob("*.mp4")):
            file.rename(_free_name(Path(video) / file.name))


def _free_name(path: Path) -> Path:
    """Return a path at which nothing is: this one, or one with a number."""
    numbered = (path.with_stem(f"{path.stem}-{number}") for number in count(2))
    return next(place for place in chain([path], numbered) if not os.path.lexists(place))


def _drive(env: gymnasium.Env, policy: str, steps: int, at_pace: bool) -> None:
    """Drive an episode, and close the environment; `at_pace` is as fast as the robot drives."""
    try:
        _drive_open(env, policy, steps, at_pace)
    finally:
        env.close()


def _drive_open(env: gymnasium.Env, policy: str, steps: int, at_pace: bool) -> None:
    mine: MineEnv = env.unwrapped  # type: ignore[assignment]
    keyboard, commands = np.zeros(2, dtype=np.float32), mine.robot.COMMANDS
    rng = np.random.default_rng(0)

    policies: dict[str, Policy] = {
        "keyboard": lambda observation: spread_command(keyboard, commands),
        "ahead": lambda observation: spread_command(ahead(observation, mine.task.beams), commands),
        "random": lambda observation: rng.uniform(-1, 1, commands).astype(np.float32),
    }

    def on_key(code: int) -> None:
        keyboard[:] = np.clip(keyboard + _KEYS[code], -1, 1) if code in _KEYS else 0.0  # any other key stops

    mine.on_key = on_key
    observation, info = env.reset(seed=0)
    began = time.perf_counter()
    for step in range(steps):
        start = time.perf_counter()
        observation, _, terminated, truncated, info = env.step(policies[policy](observation))
        if step % 50 == 0:
            pace = "" if at_pace else f"  {(step + 1) / (time.perf_counter() - began):.1f} frames/s"
            print(f"{step / 10:6.1f} s  {_figures(info, '  ')}{pace}")
            if step == 0 and not at_pace and os.environ.get("MUJOCO_GL") != "egl":
                print("pictures are drawn on the processor; with a GPU, MUJOCO_GL=egl before the command is faster")
        if terminated or truncated:
            break
        if at_pace:
            time.sleep(max(0.0, mine.task.control_s - (time.perf_counter() - start)))
    print(_figures(info, ", "))


def _figures(info: dict[str, Any], between: str) -> str:
    """Return what a player wants to know of a step."""
    goal = [f"{info['way_left_m']:.1f} m to the goal"] if "way_left_m" in info else []
    return between.join([f"coverage {100 * info['coverage']:.2f} %", f"{info['collisions']} collisions", *goal])


def time_env(env_id: str, kwargs: dict[str, Any], robots: int, threads: int, steps: int) -> None:
    """Step many robots with random commands and print control steps a second."""
    env = gymnasium.make_vec(env_id, robots, vectorization_mode="vector_entry_point", threads=threads, **kwargs)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for k in range(2 * steps):
        if k == steps:
            start = time.perf_counter()
        env.step(rng.uniform(-1, 1, env.action_space.shape))
    rate = steps * robots / (time.perf_counter() - start)
    print(f"{rate:,.0f} control steps/s: {robots} robots, {threads} threads, beams by {env.robots.lidar.backend}")  # type: ignore[attr-defined]
    env.close()


def _known_id(name: str) -> str:
    """Return an environment's id, given by itself or by NAME of MineXplore/NAME-v0, or refuse it with what to do."""
    for env_id in (name, f"MineXplore/{name}-v0"):
        found = gymnasium.registry.get(env_id)
        if found is not None and found.entry_point == ENTRY_POINT:
            return env_id
        if env_id in (FAMILY, FAMILY.replace("/", "/GoTo-")):
            raise argparse.ArgumentTypeError(f"{name} draws a mine an episode; name one that is built, as {_A_MINE}")
    known = ", ".join(environments())
    raise argparse.ArgumentTypeError(f"{name}: no environment has this id; there are {known}, and GoTo-NAME of each")


def _run() -> None:
    parser = argparse.ArgumentParser(prog="python -m minexplore", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("list", help=list_envs.__doc__).set_defaults(run=lambda a: list_envs())
    commands.add_parser("page", help=page.__doc__).set_defaults(run=lambda a: print(page(), end=""))
    player = commands.add_parser("play", help=play.__doc__)
    timer = commands.add_parser("time", help=time_env.__doc__)
    recorder = commands.add_parser("record", help="Record one episode as MCAP for ROS 2, or show it in a browser.")
    for command in (player, timer, recorder):
        command.add_argument("id", type=_known_id, metavar="ID", help=_ID)
        command.add_argument("--world", help="a bundle's folder, for MineXplore/World-v0 only")
        command.add_argument("--robot", choices=list(ROBOTS), help="another than the id's")
    player.add_argument("--policy", choices=["keyboard", "ahead", "random"], default="keyboard")
    player.add_argument("--steps", type=int, default=6000, help="control steps of 0.1 s")
    player.add_argument("--video", metavar="FOLDER", help="with --policy ahead or random")
    player.set_defaults(run=lambda a: play(a.id, given_of(a), a.policy, a.steps, a.video))
    add_arguments(recorder)
    recorder.set_defaults(run=lambda a: record(a, ahead))
    timer.add_argument("--robots", type=int, default=64)
    timer.add_argument("--threads", type=int, default=1)
    timer.add_argument("--steps", type=int, default=100)
    timer.set_defaults(run=lambda a: time_env(a.id, given_of(a), a.robots, a.threads, a.steps))
    arguments = parser.parse_args()
    check_least("steps", getattr(arguments, "steps", 1), 1)
    arguments.run(arguments)


def _refusal(error: Exception) -> str:
    """Return the line of an error of the input."""
    expected = isinstance(error, BundleError | DisplayError | ImportError | ValueError)
    return str(error) if expected or (isinstance(error, FileNotFoundError) and error.filename is None) else ""


def main() -> int:
    """Run one command; exit code 2 with one message on bad input."""
    names = [word for word in sys.argv[1:] if not word.startswith("-")]
    return run_command(names[0] if names else "minexplore", _run, _refusal)


if __name__ == "__main__":
    sys.exit(main())
