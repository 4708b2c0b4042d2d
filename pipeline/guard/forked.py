"""Work in a forked process beside this one, on what this process holds.

Stage 6 measures so, while it makes the world again: threads would wait for the interpreter, and a process of its own
would compile the model once more.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any, Generic, TypeVar

from pipeline.errors import MemoryShortageError, MineError
from pipeline.guard.process_limits import die_with_parent
from pipeline.remarks import collect_remarks, hand_on

_T = TypeVar("_T")


class Forked(Generic[_T]):
    """A function that runs in a forked process; on systems other than Linux it runs when its result is asked for.

    `with` ends the process.
    """

    def __init__(self, work: Callable[[], _T]) -> None:
        self._work, self._process = work, None
        if sys.platform == "linux":
            context = multiprocessing.get_context("fork")
            self._answer, out = context.Pipe(duplex=False)
            self._process = context.Process(target=_serve, args=(work, out, os.getpid()), daemon=True)
            with warnings.catch_warnings():
                warnings.simplefilter(
                    "ignore", DeprecationWarning
                )  # about threads; none of them holds what `work` needs
                self._process.start()
            out.close()

    def __enter__(self) -> Forked[_T]:
        return self

    def __exit__(self, *error: object) -> None:
        self.end()

    def result(self) -> _T:
        """Return what the function returns, and warn the user of what it remarked.

        Raises
        ------
        MineError
            That of the function; a `MemoryShortageError` if the process was ended.
        """
        if self._process is None:
            return self._work()
        try:
            error, value, remarks = self._answer.recv()
        except EOFError:
            self._process.join()
            if self._process.exitcode and self._process.exitcode > 0:
                raise RuntimeError("a process that measures failed; its error is above") from None
            raise MemoryShortageError("a process that measures was ended, perhaps for want of memory") from None
        finally:
            self.end()
        hand_on(remarks)
        if error is not None:
            raise error
        return value

    def end(self) -> None:
        """End the process, whether or not it is done."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._answer.close()


def _serve(work: Callable[[], Any], out: Connection, parent: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends this process
    die_with_parent(parent)
    with collect_remarks() as remarks:
        try:
            out.send((None, work(), remarks))
        except (MineError, MemoryError) as error:
            out.send((error, None, remarks))
