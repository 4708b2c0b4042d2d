"""Run a reader in a process of its own, with limits on memory, time and output.

A system without forks and limits of processes, such as Windows, runs it in this process and warns of that.
"""

from __future__ import annotations

import faulthandler
import json
import os
import select
import signal
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable
from contextlib import ExitStack, suppress
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

import cv2

from minesurveys.errors import InputError
from minesurveys.guard.answers import HEADER_BYTES, Payload, answer_to, decode
from minesurveys.guard.process_limits import die_with_parent, has_limits, processor_s, restrict
from minesurveys.limits import FILE, ReaderLimits, reader_limits

Task = Callable[..., Payload]
_CHUNK = 1 << 20
_ENDS = (signal.SIGINT, signal.SIGTERM)  # a new interpreter would print a traceback; the parent ends it
_LOOK_S = 0.1  # between two looks at the processor time of a reader
_CLOCK = 5.0  # the limit by the clock, in limits of processor time: a busy machine leaves a reader a part of a core
_UNBOUNDED = (
    "this system limits no process: what reads this file is bounded in neither memory nor time; "
    "read only files that you trust"
)

__all__ = ["Payload", "Task", "run_limited", "serve"]


def run_limited(
    task: Task,
    arguments: dict[str, Any],
    subject: str,
    extra_s: float = 0.0,
    fresh: bool = False,
    scratch_bytes: int = 0,
) -> Payload:
    """Run a task with JSON arguments in a child process, and return its payload.

    The child is forked, which takes some milliseconds. A new interpreter is started instead if other Python threads
    run, because they may hold locks, or if `fresh` is true: a library's own threads do not survive a fork. The child
    ignores Ctrl-C and is killed when this function ends for any reason. The remarks of a child that is killed are lost:
    nothing that they are about is kept.

    Parameters
    ----------
    task : function
        Of a module: a new interpreter imports it. It takes the arguments and returns a `Payload`.
    arguments : dict
        JSON values.
    subject : str
        The file; every message names it.
    extra_s : float
        Processor time in addition to the limit, s. By the clock, five times the limit may pass.
    fresh : bool
    scratch_bytes : int
        How large the temporary files are that the task may write; 0: it writes none. They lie in a folder that this
        function removes.

    Raises
    ------
    MineError
        The reader's own error, or an `InputError` that names the file and the limit that it exceeds.
    """
    if not has_limits():
        return _read_here(task, arguments, subject)
    limits, start = reader_limits(), time.monotonic()
    seconds = limits.time_s + extra_s
    begin = _spawn if fresh or _other_threads() else _fork
    with ExitStack() as stack:
        folder = ""
        if scratch_bytes:
            kept = tempfile.TemporaryDirectory(prefix="minexplore-", ignore_cleanup_errors=True)
            folder = stack.enter_context(kept)
        pid, answer = begin(task, arguments, seconds, folder, scratch_bytes)
        try:
            data = _receive(pid, answer, subject, limits, start, seconds)
        except BaseException:
            _kill(pid)
            raise
        finally:
            os.close(answer)
        status = _wait(pid)
    if status != 0:
        _raise_ended(subject, status, limits)
    return decode(subject, data)


def _read_here(task: Task, arguments: dict[str, Any], subject: str) -> Payload:
    """Run a task in this process. Its answer takes the same way as that of another process."""
    print(f"{subject}: {_UNBOUNDED}", file=sys.stderr)
    answer = answer_to(task, arguments)
    return decode(subject, b"".join(answer.parts()))


def _other_threads() -> bool:
    """Return whether other Python threads run, except tqdm's: it holds only locks that no reader takes."""
    current = threading.current_thread()
    return any(thread is not current and thread.name != "tqdm_monitor" for thread in threading.enumerate())


def _fork(task: Task, arguments: dict[str, Any], seconds: float, scratch: str, scratch_bytes: int) -> tuple[int, int]:
    answer, out = os.pipe()
    parent, threads = os.getpid(), cv2.getNumThreads()
    cv2.setNumThreads(1)  # ends OpenCV's own threads: a child would wait for those that the fork left behind
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # about threads; see `run_limited`
        pid = os.fork()
    if pid:
        cv2.setNumThreads(threads)
        os.close(out)
        return pid, answer
    status = 1
    try:
        os.close(answer)
        serve(task, arguments, out, parent, seconds, scratch, scratch_bytes)
        status = 0
    finally:
        os._exit(status)  # without the parent's exit handlers and buffers


def _spawn(task: Task, arguments: dict[str, Any], seconds: float, scratch: str, scratch_bytes: int) -> tuple[int, int]:
    answer, out = os.pipe()
    os.set_inheritable(out, True)
    words = [
        task.__module__,
        task.__qualname__,
        json.dumps(arguments),
        str(out),
        str(os.getpid()),
        str(seconds),
        scratch,
        str(scratch_bytes),
    ]
    root = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
    # Every thread reserves address space, which the limit on memory counts.
    env = {**os.environ, "PYTHONPATH": path, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    try:
        pid = os.posix_spawn(
            sys.executable, [sys.executable, "-m", "minesurveys.guard.reading_process", *words], env, setsigmask=_ENDS
        )
    finally:
        os.close(out)
    return pid, answer


def serve(
    task: Task,
    arguments: dict[str, Any],
    out: int,
    parent: int,
    seconds: float,
    scratch: str = "",
    scratch_bytes: int = 0,
) -> None:
    """Restrict this process, run the task and write its answer to the descriptor `out`.

    Temporary files go into the folder `scratch`, each up to `scratch_bytes`; without them, no file can be written.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends this process
    die_with_parent(parent)
    faulthandler.disable()  # a test runner's; the parent reports a crash
    quiet = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(quiet, stream)
    sys.stdout, sys.stderr = sys.__stdout__, sys.__stderr__  # a test runner's own are files, which may not grow
    if scratch:
        tempfile.tempdir = scratch
    restrict(reader_limits().memory_bytes, seconds, scratch_bytes)
    answer = answer_to(task, arguments)
    with os.fdopen(out, "wb") as file:
        for part in answer.parts():
            file.write(part)


def _receive(pid: int, answer: int, subject: str, limits: ReaderLimits, start: float, seconds: float) -> bytearray:
    """Return all bytes that the child writes before it ends; `seconds` limits its processor time."""
    data = bytearray()
    poll = select.poll()
    poll.register(answer, select.POLLIN | select.POLLHUP)
    notice = start + limits.notice_s
    while True:
        now = time.monotonic()
        _require_in_time(pid, subject, now - start, seconds)
        if now >= notice:
            limit = f"the limit is {seconds:.0f} s of processor time"
            print(f"{subject}: still reading after {now - start:.0f} s, {limit}", file=sys.stderr)
            notice += 2 * limits.notice_s
        if not poll.poll(1000 * _LOOK_S):
            continue
        chunk = os.read(answer, _CHUNK)
        if not chunk:
            return data
        data += chunk
        if len(data) > limits.output_bytes + HEADER_BYTES:
            raise InputError(
                f"{subject}: reading it gives more than {limits.output_bytes:,} bytes, the limit "
                f"(output_bytes in {FILE})"
            )


def _require_in_time(pid: int, subject: str, elapsed_s: float, seconds: float) -> None:
    """Refuse a reader that computes for longer than its limit, or sleeps for several times as long."""
    if elapsed_s <= seconds:  # several cores may have given more, which is no reason to end it
        return
    used_s = processor_s(pid)
    if used_s > seconds:
        raise InputError(f"{subject}: not read within {seconds:.0f} s of processor time, the limit (time_s in {FILE})")
    if elapsed_s > _CLOCK * seconds:
        raise InputError(
            f"{subject}: not read within {_CLOCK * seconds:.0f} s by the clock, {_CLOCK:g} times the limit (time_s in "
            f"{FILE}), of which it computed for {used_s:.0f} s; try again when the machine does less"
        )


def _raise_ended(subject: str, status: int, limits: ReaderLimits) -> NoReturn:
    number = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
    how = signal.Signals(number).name if number else f"exit code {os.waitstatus_to_exitcode(status)}"
    raise InputError(
        f"{subject}: the library that reads it crashed ({how}); the file is broken, or needs more than "
        f"{limits.memory_bytes / 1e9:g} GB of memory (memory_bytes in {FILE})"
    )


def _kill(pid: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)
    with suppress(ChildProcessError):
        os.waitpid(pid, 0)


def _wait(pid: int) -> int:
    try:
        return os.waitpid(pid, 0)[1]
    except ChildProcessError:
        return 0


if __name__ == "__main__":
    _module, _name, _arguments, _out, _parent, _seconds, _scratch, _bytes = sys.argv[1:]
    _task = getattr(import_module(_module), _name)
    serve(_task, json.loads(_arguments), int(_out), int(_parent), float(_seconds), _scratch, int(_bytes))
