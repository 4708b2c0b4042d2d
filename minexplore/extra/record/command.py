"""`python -m minexplore record`: drive one episode and keep or show what the robot's sensors read."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, Protocol

import gymnasium
import numpy as np

from minexplore.ends import uninterrupted
from minexplore.envs.env import MineEnv
from minexplore.extra.record.episode import SensedStep, frames_of
from minexplore.extra.record.live import LiveView, require_viser
from minexplore.extra.record.mcap_file import McapFile, require_mcap, require_new
from minexplore.extra.record.policies import Ahead, Drive, find_drive
from minexplore.physics.robots import find_robot
from minexplore.sensing.params import preset_names
from minexplore.sensors.table import check_sensors, sensor_names

_LAST_PORT = 65_535  # of TCP


class Sink(Protocol):
    """Takes the frames of an episode."""

    def add(self, frame: SensedStep) -> None:
        """Take one frame."""

    def close(self) -> None:
        """Finish."""

    def drop(self) -> None:
        """Leave nothing of what is not finished."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the command."""
    parser.add_argument("--policy", default="ahead", help="ahead, random, an explorer, or to a goal planner, map-free")
    parser.add_argument("--sensors", default="os1-64,depth,imu", help=f"of {', '.join(sensor_names())}")
    parser.add_argument("--conditions", choices=preset_names(), default="typical", help="noise, dust and water")
    parser.add_argument("--pose", choices=["true", "odometry"], default="true", help="what the policy gets")
    parser.add_argument("--steps", type=int, default=600, help="control steps of 0.1 s")
    parser.add_argument("--every", type=int, default=1, help="read the sensors once in so many steps")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, metavar="FILE", help="an MCAP file with ROS 2 messages")
    parser.add_argument("--live", type=int, metavar="PORT", nargs="?", const=8080, help="show it in a browser")


def given_of(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the arguments of an environment that were given.

    Raises
    ------
    ValueError
        If a world is given for an id that has one.
    """
    given = {key: value for key in ("world", "robot") if (value := getattr(arguments, key)) is not None}
    if "world" in given and "world" in gymnasium.spec(arguments.id).kwargs:
        raise ValueError(
            f"world = {given['world']!r}: {arguments.id} has its own; want MineXplore/World-v0 for another"
        )
    return given


def check_least(name: str, value: int, least: int) -> None:
    """Refuse an option below its least value.

    Raises
    ------
    ValueError
    """
    if value < least:
        raise ValueError(f"{name} = {value}: want {least} or more")


def record(arguments: argparse.Namespace, ahead: Ahead) -> None:
    """Record one episode as MCAP with ROS 2 messages, or show it in a browser.

    Raises
    ------
    ImportError
        If what writes or shows it is not installed; the message names the extra.
    ValueError
        If an option is beyond its limit.
    """
    sensors = check_sensors([name for name in arguments.sensors.split(",") if name])
    for name, low in (("steps", 1), ("every", 1), ("seed", 0)):
        check_least(name, getattr(arguments, name), low)
    if arguments.live is not None and not 0 <= arguments.live <= _LAST_PORT:
        raise ValueError(f"live = {arguments.live}: want a port from 0 to {_LAST_PORT}; 0 takes one that is free")
    if arguments.out is None and arguments.live is None:
        raise ValueError("nothing to do: give --out FILE, --live, or both")
    _require(arguments)
    kwargs = given_of(arguments)
    robot = find_robot((gymnasium.spec(arguments.id).kwargs | kwargs).get("robot"))
    pose = arguments.pose if robot.FLIES else "odometry"  # refused of what has no wheels
    made = gymnasium.make(arguments.id, pose=pose, conditions=arguments.conditions, **kwargs)
    env: MineEnv = made.unwrapped  # type: ignore[assignment]
    drive = find_drive(arguments.policy, env, arguments.seed, ahead)
    sinks: list[Sink] = []
    try:
        if arguments.out is not None:
            with uninterrupted():
                sinks.append(McapFile(arguments.out, env.suite))
        if arguments.live is not None:
            view = LiveView(env.suite, arguments.live)
            sinks.append(view)
            print(f"open {view.address}", flush=True)
        summary = _run(env, drive, sensors, arguments, sinks)
        for sink in sinks:
            sink.close()
    finally:
        with uninterrupted():
            for sink in sinks:
                sink.drop()
            made.close()
    size = f", {arguments.out} {arguments.out.stat().st_size / 1e6:.1f} MB" if arguments.out else ""
    print(f"{summary}{size}")


def _require(arguments: argparse.Namespace) -> None:
    if arguments.out is not None:
        require_mcap()
        if not arguments.out.parent.is_dir():
            raise ValueError(f"out = {str(arguments.out)!r}: no folder {arguments.out.parent}")
        require_new(arguments.out)
    if arguments.live is not None:
        require_viser()


def _run(env: MineEnv, drive: Drive, sensors: tuple[str, ...], arguments: argparse.Namespace, sinks: list[Sink]) -> str:
    """Drive the episode into the sinks; return what it was."""
    steps, seed, every = arguments.steps, arguments.seed, arguments.every
    frames = frames_of(env, drive, sensors, steps, seed, every, arguments.pose == "true")
    count, looks, frame = 0, 0, None
    for count, frame in enumerate(frames):  # noqa: B007
        looks += bool(frame.readings)
        for sink in sinks:
            sink.add(frame)
    if frame is None:
        return "0 steps"
    error_m = float(np.linalg.norm(frame.counted.place_m[:2] - frame.robot.place_m[:2]))
    wheels = "" if env.robot.FLIES else f", odometry off by {error_m:.2f} m"
    left_m = env.robots.rules.info(np.arange(1)).get("way_left_m")
    goal = "" if left_m is None else f", {left_m[0]:.1f} m to the goal"
    return f"{count} steps, {looks} looks, coverage {100 * frame.coverage:.2f} %{goal}{wheels}"
