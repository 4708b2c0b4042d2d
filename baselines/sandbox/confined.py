"""A stranger's policy in a sandbox of its own.

The environment stays in this process: all that the policy can do to an episode is to send commands.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import signal
import subprocess
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any

import numpy as np

from baselines.base.errors import BaselineError
from baselines.sandbox.bubblewrap import POLICY, PROJECT, Limits, library_folders, sandbox_command
from baselines.sandbox.channel import ACT, DONE, MAKE, RESET, Channel, ChannelError
from baselines.sandbox.policy_copy import copy_policy
from baselines.sandbox.policy_server import HEIGHTS
from minexplore.physics.robot import RobotParams
from minexplore.physics.robot_kind import Robot
from minexplore.task import TaskParams

_MOST_ANSWER = 1 << 20
_MOST_MESSAGE = 500  # bytes of a policy's error in a message
_START_S = 120.0  # to start Python and import the policy; it counts against the limit too
# The policy's folder comes last: none of its files can take the place of a module that is imported before the limits.
_PROGRAM = (
    "import json, sys; sys.path += json.loads(sys.argv[1]); from baselines.sandbox.policy_process import main; main()"
)


@dataclasses.dataclass(frozen=True)
class Confined:
    """The policy that may run, by its hash, and its limits; any policy may run if there is no hash.

    The policy is copied into `folder`, which is the folder of temporary files by default.
    """

    limits: Limits = dataclasses.field(default_factory=Limits)
    sha256: str | None = None
    folder: Path | None = None


class ConfinedPolicy:
    """A policy as `baselines.policies.policy_lookup.Policy` describes, made and called in a sandbox.

    Use it in a `with` statement: leaving it ends the process.
    """

    def __init__(
        self,
        name: str,
        count: int,
        task: TaskParams,
        robot: Robot,
        confined: Confined,
        heights: bool = False,
    ) -> None:
        """Copy the policy, compare its hash, then start the sandbox and make the policy in it.

        Parameters
        ----------
        name : str
            `module:Class` or a file NAME.safetensors.
        count, task, robot, heights
            As `baselines.policies.policy_lookup.make_policy` takes them.
        confined : Confined

        Raises
        ------
        BaselineError
            If there is no such policy, it is another than `confined` names, it fails, or it exceeds its limits.
        """
        if not isinstance(robot, RobotParams):
            raise BaselineError(
                f"policy = {name!r}: it is confined, and drives the default robot only, not {robot.KIND}"
            )
        self._name, self._count, self._limits, self._used_s = name, count, confined.limits, 0.0
        self._sent = ("pose_m_rad", *(HEIGHTS if heights else ()))
        params = {"task": _fields(TaskParams, task), "robot": _fields(RobotParams, robot)}
        with contextlib.ExitStack() as stack:
            folder = Path(stack.enter_context(TemporaryDirectory(prefix="policy-", dir=confined.folder)))
            copy = copy_policy(name, folder, confined.sha256)
            self._process, self._channel = _start(folder, confined.limits, stack)
            self._await(None, b"")
            asked = json.dumps({"name": copy.name_inside(POLICY), "count": count, "heights": heights, **params})
            self._await(MAKE, asked.encode())
            self._open = stack.pop_all()

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Begin an episode of each robot."""
        if len(robots) != self._count:
            raise ValueError(f"reset of {len(robots)} robots: want all {self._count}")
        self._await(RESET, json.dumps(seeds.tolist()).encode())

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return the policy's commands (n, 2).

        It gets the observations and the poses, in a mine with heights the robots' attitudes too, and nothing else.
        """
        stated = b"".join(np.ascontiguousarray(info[key], dtype=np.float64).tobytes() for key in self._sent)
        answer = self._await(ACT, stated + np.ascontiguousarray(observation, dtype=np.float32).tobytes())
        if len(answer) != 16 * self._count:
            raise BaselineError(f"policy {self._name}: it sends {len(answer)} bytes, want {16 * self._count}")
        action = np.frombuffer(answer, np.float64).reshape(self._count, 2)
        if not np.isfinite(action).all():
            raise BaselineError(f"policy {self._name}: a command is not finite")
        return action

    def _await(self, kind: int | None, payload: bytes) -> bytes:
        """Send a call, unless `kind` is None, and return its answer within what is left of the policy's time."""
        begun = time.monotonic()
        until = begun + min(self._limits.time_s - self._used_s, _START_S if kind in (None, MAKE) else np.inf)
        try:
            if kind is not None:
                self._channel.send(kind, payload, until)
            answer = self._channel.receive(until)
        except ChannelError as error:
            raise BaselineError(f"policy {self._name}: {error} ({self._limits_text()})") from error
        finally:
            self._used_s += time.monotonic() - begun
        if answer.kind != DONE:
            message = answer.payload[:_MOST_MESSAGE].decode(errors="replace").encode("unicode_escape").decode()
            raise BaselineError(f"policy {self._name}: {message}")
        return answer.payload

    def _limits_text(self) -> str:
        limits = self._limits
        return f"limits: {limits.memory_bytes / 2**30:g} GB of memory, {limits.time_s:g} s of its own time"

    def close(self) -> None:
        """End the process."""
        self._open.close()

    def __enter__(self) -> ConfinedPolicy:
        """Return the policy."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        """End the process."""
        self.close()


def _fields(kind: type, value: TaskParams | RobotParams) -> dict[str, Any]:
    """Return the fields of task or robot that every one of its kind has."""
    return {field.name: getattr(value, field.name) for field in dataclasses.fields(kind)}


def _start(folder: Path, limits: Limits, stack: contextlib.ExitStack) -> tuple[subprocess.Popen[bytes], Channel]:
    """Start a sandbox with a policy's folder; return its process and a channel to it. The stack ends both."""
    ours, theirs = os.pipe(), os.pipe()  # (reading, writing): from the policy, to the policy
    stack.callback(_close, ours[0], theirs[1])
    try:
        modules = json.dumps([*library_folders(), PROJECT, POLICY])
        words = [modules, str(theirs[0]), str(ours[1]), str(limits.memory_bytes), str(limits.time_s)]
        process = subprocess.Popen(
            sandbox_command(folder, _PROGRAM, *words),
            pass_fds=(theirs[0], ours[1]),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
    finally:
        _close(theirs[0], ours[1])
    stack.callback(_end, process)
    return process, Channel(ours[0], theirs[1], _MOST_ANSWER)


def _close(*pipes: int) -> None:
    for pipe in pipes:
        os.close(pipe)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a sandbox; the kernel ends what runs inside with it."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
