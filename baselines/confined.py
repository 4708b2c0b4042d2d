"""A policy in a process of its own, without network, writing or other processes where the system allows it.

The environment stays in this process: all that the policy can do to an episode is to send commands.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from baselines.channel import ACT, DONE, MAKE, RESET, Channel, ChannelError
from baselines.confinement import Confinement, Limits
from baselines.errors import BaselineError, RejectedError
from baselines.policy_server import HEIGHTS
from minexplore.robot import RobotParams
from minexplore.task import TaskParams

_MOST_ANSWER = 1 << 20
_START_S = 120.0  # to start Python and import the policy; it counts against the limit too
_PROJECT = Path(__file__).parents[1]
# No file beside the policy can take the place of a module that is imported before the process is confined.
_PROGRAM = "import sys; sys.path.append(sys.argv[1]); from baselines.policy_process import main; main()"
_KEPT = ("PATH", "LD_LIBRARY_PATH", "LANG", "VIRTUAL_ENV")  # of this process's variables; others may hold secrets


@dataclasses.dataclass(frozen=True)
class Confined:
    """Which policy is let in, by its hash, and what it may use; without a hash, any."""

    limits: Limits = dataclasses.field(default_factory=Limits)
    sha256: str | None = None


class ConfinedPolicy:
    """A policy as `baselines.policy.Policy` describes, made and called in a confined process.

    Use it in a `with` statement: leaving it ends the process.
    """

    def __init__(
        self,
        name: str,
        count: int,
        task: TaskParams,
        robot: RobotParams,
        confined: Confined,
        heights: bool = False,
    ) -> None:
        """Start the process and make the policy in it; see `baselines.policy.make_policy`.

        Raises
        ------
        BaselineError
            If there is no such policy, it is another than `confined` names, it fails, or it exceeds its limits.
        """
        self._name, self._count, self._limits, self._used_s = name, count, confined.limits, 0.0
        self._sent = ("pose_m_rad", *(HEIGHTS if heights else ()))
        self._process, self._channel, self._pipes = _start(confined.limits)
        try:
            self._await(None, b"")
            params = {"task": _fields(TaskParams, task), "robot": _fields(RobotParams, robot)}
            asked = json.dumps({"name": name, "count": count, "heights": heights, **params})
            found = self._await(MAKE, asked.encode())[:64].decode("ascii", "replace")
            if confined.sha256 is not None and found != confined.sha256:
                raise RejectedError(f"policy {name} is {found[:12]} here, not {confined.sha256[:12]}")
        except BaseException:
            self.close()
            raise

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
            raise BaselineError(f"policy {self._name}: {error} ({self._limits_said()})") from error
        finally:
            self._used_s += time.monotonic() - begun
        if answer.kind != DONE:
            said = answer.payload.decode(errors="replace").encode("unicode_escape").decode()
            raise BaselineError(f"policy {self._name}: {said}")
        return answer.payload

    def _limits_said(self) -> str:
        limits = self._limits
        return f"limits: {limits.memory_bytes / 2**30:g} GB of memory, {limits.time_s:g} s of its own time"

    def close(self) -> None:
        """End the process and all that it started."""
        if self._process.returncode is None:
            _end(self._process, self._pipes)

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


def what_is_held(limits: Limits) -> Confinement:
    """Return what this system lets a confined process be without."""
    process, channel, pipes = _start(limits)
    try:
        return Confinement(**json.loads(channel.receive(time.monotonic() + _START_S).payload))
    except ChannelError as error:
        raise BaselineError(f"a confined process does not start here: {error}") from error
    finally:
        _end(process, pipes)


def _start(limits: Limits) -> tuple[subprocess.Popen[bytes], Channel, tuple[int, ...]]:
    """Start a confined process; return it, a channel to it, and the channel's pipes."""
    ours, theirs = os.pipe(), os.pipe()  # (reading, writing): from the policy, to the policy
    words = [str(_PROJECT), theirs[0], ours[1], limits.memory_bytes, limits.time_s]
    kept = {key: os.environ[key] for key in _KEPT if key in os.environ}
    single = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    process = subprocess.Popen(
        [sys.executable, "-s", "-P", "-c", _PROGRAM, *map(str, words)],
        pass_fds=(theirs[0], ours[1]),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        env={**kept, **single, "PYTHONDONTWRITEBYTECODE": "1"},
    )
    os.close(theirs[0])
    os.close(ours[1])
    return process, Channel(ours[0], theirs[1], _MOST_ANSWER), (ours[0], theirs[1])


def _end(process: subprocess.Popen[bytes], pipes: tuple[int, ...]) -> None:
    """End a process and all that it started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    for pipe in pipes:
        os.close(pipe)
