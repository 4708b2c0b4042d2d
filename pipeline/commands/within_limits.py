"""Run work on a stranger's files in a process of its own, whose memory and processor time are limited."""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading
import traceback
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

from minesurveys.guard.process_limits import die_with_parent
from pipeline.errors import InputError, MineError

_T = TypeVar("_T")
_GB = 1_000_000_000


def within_limits(work: Callable[[], _T], subject: str, memory_bytes: int, seconds: int) -> _T:
    """Return what `work` returns, which runs in a forked process with limits on its memory and processor time.

    Each process that it forks has the same limits. Where other threads run, which a forked process would not have, and
    on systems other than Linux, it runs here and without limits.

    Raises
    ------
    MineError
        That of the work, or an `InputError` that names `subject` and the limit which the process reached.
    """
    if sys.platform != "linux" or threading.active_count() > 1:
        return work()
    file, parent = os.memfd_create("result"), os.getpid()
    pid = os.fork()
    if pid == 0:
        status = 1
        try:
            die_with_parent(parent)
            _restrict(memory_bytes, seconds)
            _serve(work, file, f"{subject}: needs more than {memory_bytes / _GB:g} GB of memory")
            status = 0
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            os._exit(status)  # without the parent's exit handlers
    with os.fdopen(file, "r+b") as answer:
        status = _wait(pid)
        if os.WIFSIGNALED(status):
            raise InputError(_ended(subject, os.WTERMSIG(status), memory_bytes, seconds))
        if os.waitstatus_to_exitcode(status):
            raise RuntimeError("a process with limits failed; its error is above")
        answer.seek(0)
        error, value = pickle.load(answer)  # noqa: S301 - this process's own
    if error is not None:
        raise error
    found: _T = value
    return found


def _serve(work: Callable[[], object], file: int, shortage: str) -> None:
    try:
        answer: tuple[Exception | None, object] = (None, work())
    except MineError as error:
        answer = (error, None)
    except MemoryError:
        answer = (InputError(shortage), None)
    with os.fdopen(file, "wb", closefd=False) as out:
        pickle.dump(answer, out, pickle.HIGHEST_PROTOCOL)


def _restrict(memory_bytes: int, seconds: int) -> None:
    import resource  # here and not above: Windows has no such module

    for kind, value in (
        (resource.RLIMIT_DATA, memory_bytes),
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_CORE, 0),
    ):
        hard = resource.getrlimit(kind)[1]
        value = value if hard == resource.RLIM_INFINITY else min(value, hard)
        resource.setrlimit(kind, (value, value))


def _wait(pid: int) -> int:
    """Return how a process ended; if this one is interrupted meanwhile, both end."""
    try:
        return os.waitpid(pid, 0)[1]
    except BaseException:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        raise


def _ended(subject: str, number: int, memory_bytes: int, seconds: int) -> str:
    if number in (signal.SIGXCPU, signal.SIGKILL):
        return f"{subject}: needs more than {seconds} s of processor time or {memory_bytes / _GB:g} GB of memory"
    return (
        f"{subject}: a library crashed ({signal.Signals(number).name}), perhaps as it needs more than "
        f"{memory_bytes / _GB:g} GB of memory"
    )
