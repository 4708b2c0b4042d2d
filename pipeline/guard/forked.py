"""Work in forked processes beside this one, on what this process holds.

Stage 6 measures so, while it makes the world again, and volumes are checked so on all cores: threads would wait for the
interpreter, and a new process would have to load all that this one holds.
"""

from __future__ import annotations

import mmap
import multiprocessing
import os
import pickle
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Lock
from typing import IO, Any, Generic, TypeVar

from pipeline.errors import MemoryShortageError, MineError
from pipeline.guard.process_limits import die_with_parent
from pipeline.remarks import collect_remarks, hand_on

_T = TypeVar("_T")
_ENDS = (signal.SIGINT, signal.SIGTERM)  # signals that end a command
_MOST = 4  # processes at a time: the memory that each one writes to adds up
_SHARES = 8  # of the work, to each process: what takes long in one is made up for by the others
_sharing = False  # whether this process works at its share


class Forked(Generic[_T]):
    """A function that runs in a forked process.

    On systems other than Linux, and if it is not to run apart, it runs when its result is asked for.

    `with` ends the process; so does the loss of the last reference, as nobody can ask for the result then. A process
    that is done ends, and its result waits in a file in memory. Another process that is forked after this object was
    made may ask for the result as well.
    """

    def __init__(self, work: Callable[[], _T], apart: bool = True) -> None:
        self._work: Callable[[], _T] | None = work
        self._process, self._owner = None, os.getpid()
        if apart and sys.platform == "linux":
            context = multiprocessing.get_context("fork")
            self._answer, out = context.Pipe(duplex=False)
            self._file = os.fdopen(os.memfd_create("result"), "w+b")
            process = context.Process(target=_serve, args=(work, self._file, out, os.getpid()), daemon=True)
            with warnings.catch_warnings():
                warnings.simplefilter(
                    "ignore", DeprecationWarning
                )  # about threads; none of them holds what `work` needs
                before = signal.pthread_sigmask(signal.SIG_BLOCK, _ENDS)  # until `_serve` has its own handlers
                try:
                    process.start()
                finally:
                    signal.pthread_sigmask(signal.SIG_SETMASK, before)
            self._process = process
            self._work = None  # the other process holds it now
            out.close()

    def __enter__(self) -> Forked[_T]:
        return self

    def __exit__(self, *error: object) -> None:
        self.end()

    def __del__(self) -> None:
        self.end()

    def result(self) -> _T:
        """Return what the function returns, and pass its warnings on to the user.

        Raises
        ------
        MineError
            That of the function; a `MemoryShortageError` if the process was ended.
        """
        if self._work is not None:
            return self._work()
        try:
            self._answer.recv_bytes()
            self._file.seek(0)
            error, value, remarks = pickle.load(self._file)  # noqa: S301 - this process's own
        except EOFError:
            code = self._exit_code()
            if code is None or code > 0:
                raise RuntimeError("a process that measures failed; its error is above") from None
            raise MemoryShortageError("a process that measures was ended, perhaps for want of memory") from None
        finally:
            self.end()
        hand_on(remarks)
        if error is not None:
            raise error
        return value

    def _exit_code(self) -> int | None:
        """Return how the process has ended; None in a process that did not begin it, and cannot know."""
        if self._process is None or self._owner != os.getpid():
            return None
        self._process.join()
        return self._process.exitcode

    def end(self) -> None:
        """End the process, whether or not it is done; a copy of this object in another process leaves it alone."""
        if self._process is not None and self._owner == os.getpid():
            self._process.kill()
            self._process.join()
            self._answer.close()
            self._file.close()


def _serve(work: Callable[[], Any], file: IO[bytes], out: Connection, parent: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends this process
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # the parent's handler would end in a traceback here
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDS)
    die_with_parent(parent)
    multiprocessing.current_process().daemon = False  # it may have forked processes, which end with it
    with collect_remarks() as remarks:
        try:
            answer: Any = (None, work(), remarks)
        except (MineError, MemoryError) as error:
            answer = (error, None, remarks)
        pickle.dump(answer, file, pickle.HIGHEST_PROTOCOL)
        file.flush()
        out.send_bytes(b"done")


def in_shares(work: Callable[[int, int], _T], count: int, least: int = 1) -> list[_T]:
    """Return what `work` returns for ranges of numbers that together are 0 to `count`, in order, by all cores.

    `work` takes the first number and the one after the last. What it returns for each number must not depend on the
    range, so that it is the same on any number of cores. `work` must not call manifold3d, which waits for threads that
    a forked process does not have. A range has at least `least` numbers: fewer are not worth a process. In a process
    that another one began, and within the work of another share, all is one range.

    Raises
    ------
    MineError
        As `Forked.result`.
    """
    global _sharing
    shares = min(_processes() * _SHARES, count // least)
    processes = min(_processes(), shares)
    if processes < 2:
        return [work(0, count)] if count else []
    ends = [count * k // shares for k in range(shares + 1)]
    taken, lock = mmap.mmap(-1, shares), multiprocessing.get_context("fork").Lock()

    def some(process: int) -> list[tuple[int, _T]]:
        first = shares * process // processes
        return [(k, work(ends[k], ends[k + 1])) for k in _not_taken(taken, lock, first)]

    others = [Forked(partial(some, process)) for process in range(1, processes)]
    try:
        _sharing = True
        found = some(0)
        for other in others:
            found += other.result()
    finally:
        _sharing = False
        for other in others:
            other.end()
    return [value for _, value in sorted(found, key=lambda one: one[0])]


def _processes() -> int:
    """Return how many processes may share the work of this one."""
    if sys.platform != "linux" or _sharing or multiprocessing.parent_process() is not None:
        return 1
    return min(len(os.sched_getaffinity(0)), _MOST)


def _not_taken(taken: mmap.mmap, lock: Lock, first: int) -> Iterator[int]:
    """Take the shares that no process has taken, and yield their numbers: from `first` on, then those before it."""
    for k in [*range(first, len(taken)), *range(first)]:
        with lock:
            mine = not taken[k]
            taken[k] = 1
        if mine:
            yield k
