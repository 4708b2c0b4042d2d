"""Run a reader in a process of its own, with limits on memory, time and output."""

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
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import cv2
import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from pipeline.errors import (
    DoubtError,
    GeometryError,
    InputError,
    MineError,
    ParamsError,
    UnexpectedError,
    describe_os_error,
)
from pipeline.guard.process_limits import die_with_parent, resolve, restrict
from pipeline.params.reader_limits import FILE, ReaderLimits, reader_limits

_ERRORS: dict[str, type[MineError]] = {
    kind.__name__: kind for kind in (InputError, ParamsError, GeometryError, UnexpectedError)
}
_PICTURE = "shown"  # the array with the picture of a `DoubtError`
_DTYPES = ("uint8", "bool", "int32", "int64", "float32", "float64")
_HEADER_BYTES = 64_000_000
_CHUNK = 1 << 20
_MOST_WARNINGS = 100
_warnings: list[str] = []  # in the process of a reader, whose standard error goes nowhere
_shown: set[str] = set()  # warnings of readers' processes: a file is read twice, to detect it and in stage 1


@dataclass(frozen=True)
class Payload:
    """What a reader hands back: plain JSON values, and arrays."""

    values: Any
    arrays: dict[str, np.ndarray] = field(default_factory=dict)


def warn_user(line: str) -> None:
    """Warn the user, on standard error, of what a reader left out or assumed; also from a process of `run_limited`."""
    if len(_warnings) < _MOST_WARNINGS:
        _warnings.append(line)
    print(one_line(line), file=sys.stderr)


class _Header(BaseModel):
    """The first part of an answer. The bytes of the arrays follow it."""

    model_config = ConfigDict(extra="forbid")

    error: str = ""
    message: str = ""
    warnings: list[str] = []
    values: Any = None
    arrays: list[tuple[str, str, list[int]]] = []


def run_limited(
    task: str,
    arguments: dict[str, Any],
    subject: str,
    extra_s: float = 0.0,
    fresh: bool = False,
    scratch: bool = False,
) -> Payload:
    """Run a task with JSON arguments in a child process, and return its payload.

    The child is forked, which takes some milliseconds. A new interpreter is started instead if other Python threads
    run, because they may hold locks, or if `fresh` is true: a library's own threads do not survive a fork. The child
    ignores Ctrl-C and is killed when this function ends for any reason.

    Parameters
    ----------
    task : str
        A name in `TASKS`. Its function takes the arguments and returns a `Payload`.
    arguments : dict
        JSON values.
    subject : str
        The file; every message names it.
    extra_s : float
        Time in addition to the limit.
    fresh : bool
    scratch : bool
        Whether the task may write temporary files, each up to `scratch_bytes`: they lie in a folder that this function
        removes.

    Raises
    ------
    MineError
        The reader's own error, or an `InputError` that names the file and the limit that it exceeds.
    """
    limits, start = reader_limits(), time.monotonic()
    seconds = limits.time_s + extra_s
    begin = _spawn if fresh or _other_threads() else _fork
    with ExitStack() as stack:
        folder = ""
        if scratch:
            kept = tempfile.TemporaryDirectory(prefix="minexplore-", ignore_cleanup_errors=True)
            folder = stack.enter_context(kept)
        pid, answer = begin(task, arguments, seconds, folder)
        try:
            data = _receive(answer, subject, limits, start, seconds)
        except BaseException:
            _kill(pid)
            raise
        finally:
            os.close(answer)
        status = _wait(pid)
    if status != 0:
        _raise_ended(subject, status, limits)
    return _decode(subject, data)


def _other_threads() -> bool:
    """Return whether other Python threads run, except tqdm's: it holds only locks that no reader takes."""
    current = threading.current_thread()
    return any(thread is not current and thread.name != "tqdm_monitor" for thread in threading.enumerate())


def _fork(task: str, arguments: dict[str, Any], seconds: float, scratch: str) -> tuple[int, int]:
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
        serve(task, arguments, out, parent, seconds, scratch)
        status = 0
    finally:
        os._exit(status)  # without the parent's exit handlers and buffers


def _spawn(task: str, arguments: dict[str, Any], seconds: float, scratch: str) -> tuple[int, int]:
    answer, out = os.pipe()
    os.set_inheritable(out, True)
    words = [task, json.dumps(arguments), str(out), str(os.getpid()), str(seconds), scratch]
    root = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
    # Every thread reserves address space, which the limit on memory counts.
    env = {**os.environ, "PYTHONPATH": path, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    try:
        pid = os.posix_spawn(sys.executable, [sys.executable, "-m", "pipeline.guard.reading_process", *words], env)
    finally:
        os.close(out)
    return pid, answer


def serve(task: str, arguments: dict[str, Any], out: int, parent: int, seconds: float, scratch: str = "") -> None:
    """Restrict this process, run the task and write its answer to the descriptor `out`.

    Temporary files go into the folder `scratch`; without one, no file can be written.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends this process
    die_with_parent(parent)
    faulthandler.disable()  # a test runner's; the parent reports a crash
    quiet = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(quiet, stream)
    if scratch:
        tempfile.tempdir = scratch
    restrict(reader_limits().memory_bytes, seconds, reader_limits().scratch_bytes if scratch else 0)
    header, arrays = _Header(), {}
    _warnings.clear()
    try:
        payload = resolve(task)(**arguments)
        arrays = {name: np.ascontiguousarray(array) for name, array in payload.arrays.items()}
        header = _Header(warnings=_warnings, values=payload.values, arrays=_shapes(arrays))
    except DoubtError as error:
        arrays = {_PICTURE: np.ascontiguousarray(error.picture)}
        header = _Header(error="DoubtError", message=str(error), arrays=_shapes(arrays))
    except MineError as error:
        name = type(error).__name__
        header = _Header(error=name if name in _ERRORS else "InputError", message=str(error))
    except MemoryError:
        header = _Header(error="MemoryError")
    except (PermissionError, FileNotFoundError) as error:  # another user's file, or it vanished
        header = _Header(error="InputError", message=f"{describe_os_error(error)}; it cannot be read")
    except Exception as error:  # a library's exception that the reader does not name
        no_memory = "bad_alloc" in str(error) or "Insufficient memory" in str(error)  # C++ libraries
        header = _Header(
            error="MemoryError" if no_memory else "UnexpectedError", message=f"{type(error).__name__}: {error}"[:1000]
        )
    head = json.dumps(header.model_dump(), allow_nan=True).encode()
    with os.fdopen(out, "wb") as answer:
        answer.write(len(head).to_bytes(8, "little") + head)
        for array in arrays.values():
            answer.write(array.reshape(-1).view(np.uint8).data)


def _shapes(arrays: dict[str, np.ndarray]) -> list[tuple[str, str, list[int]]]:
    return [(name, str(array.dtype), list(array.shape)) for name, array in arrays.items()]


def _receive(answer: int, subject: str, limits: ReaderLimits, start: float, seconds: float) -> bytearray:
    """Return all bytes that the child writes before it ends."""
    data = bytearray()
    poll = select.poll()
    poll.register(answer, select.POLLIN | select.POLLHUP)
    notice = start + limits.notice_s
    while True:
        now = time.monotonic()
        if now - start > seconds:
            raise InputError(f"{subject}: not read within {seconds:.0f} s, the limit (time_s in {FILE})")
        if now >= notice:
            print(f"{subject}: still reading after {now - start:.0f} s, the limit is {seconds:.0f} s", file=sys.stderr)
            notice += 2 * limits.notice_s
        if not poll.poll(1000 * max(0.01, min(notice, start + seconds + 0.05) - now)):
            continue
        chunk = os.read(answer, _CHUNK)
        if not chunk:
            return data
        data += chunk
        if len(data) > limits.output_bytes + _HEADER_BYTES:
            raise InputError(
                f"{subject}: reading it gives more than {limits.output_bytes:,} bytes, the limit "
                f"(output_bytes in {FILE})"
            )


def _decode(subject: str, data: bytearray) -> Payload:
    """Return the payload of an answer. Its sizes and types are checked; nothing in it is executed."""
    size = int.from_bytes(data[:8], "little")
    try:
        if size > min(_HEADER_BYTES, len(data) - 8):
            raise ValueError("the header is longer than the answer")
        header = _Header.model_validate(json.loads(data[8 : 8 + size]))
        for line in header.warnings:
            if line not in _shown:
                _shown.add(line)
                print(one_line(line), file=sys.stderr)
        arrays, at = {}, 8 + size
        for name, dtype, shape in header.arrays:
            if dtype not in _DTYPES or min(shape, default=0) < 0:
                raise ValueError(f"an array of {dtype} {shape}")
            count = int(np.prod(shape, dtype=object))
            if at + count * np.dtype(dtype).itemsize > len(data):
                raise ValueError("an array is longer than the answer")
            arrays[name] = np.frombuffer(data, dtype, count, at).reshape(shape)
            at += arrays[name].nbytes
        if header.error:
            _raise_stated(subject, header, arrays.get(_PICTURE))
    except (ValueError, RecursionError, ValidationError) as error:
        raise InputError(f"{subject}: its reader gave a broken answer ({one_line(str(error))})") from error
    return Payload(header.values, arrays)


def _raise_stated(subject: str, header: _Header, shown: np.ndarray | None) -> NoReturn:
    if header.error == "MemoryError":
        most_gb = reader_limits().memory_bytes / 1e9
        raise InputError(f"{subject}: needs more than {most_gb:g} GB of memory (memory_bytes in {FILE})")
    message = one_line(header.message)
    if header.error == "UnexpectedError":
        raise UnexpectedError(f"{subject}: cannot be read ({message})")
    if shown is not None and shown.ndim == 3 and shown.shape[2] == 3 and shown.dtype == np.uint8:
        raise DoubtError(message, shown)
    raise _ERRORS.get(header.error, InputError)(message)


def _raise_ended(subject: str, status: int, limits: ReaderLimits) -> NoReturn:
    number = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
    how = signal.Signals(number).name if number else f"exit code {os.waitstatus_to_exitcode(status)}"
    raise InputError(
        f"{subject}: the library that reads it crashed ({how}); the file is broken, or needs more than "
        f"{limits.memory_bytes / 1e9:g} GB of memory (memory_bytes in {FILE})"
    )


def one_line(text: str, most: int = 600) -> str:
    """Return printable text on one line; a file's content cannot add lines or control a terminal."""
    clean = "".join(c if c.isprintable() else " " for c in text)
    return clean if len(clean) <= most else clean[: most - 3] + "..."


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
    _task, _arguments, _out, _parent, _seconds, _scratch = sys.argv[1:]
    serve(_task, json.loads(_arguments), int(_out), int(_parent), float(_seconds), _scratch)
