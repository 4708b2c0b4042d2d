"""How a command of this package ends: one line, and an exit code."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import pairwise
from types import FrameType
from typing import Any, NoReturn

REFUSED, INTERRUPTED, UNREAD = 2, 130, 141  # exit codes; the last two as shells show SIGINT and SIGPIPE
Handler = Callable[[int, FrameType | None], Any] | signal.Handlers


def end_at_once_if_interrupted(*packages: str) -> None:
    """Let Ctrl-C and SIGTERM end a command of these packages in one line while it still loads its libraries.

    `run_command` replaces this. A program that imports the packages keeps its own handlers.
    """
    name = next((word for option, word in pairwise(sys.orig_argv) if option == "-m"), "")
    if any(name == package or name.startswith(f"{package}.") for package in packages):

        def end(kind: int, frame: object) -> NoReturn:
            with suppress(OSError):
                os.write(2, f"{name}: interrupted\n".encode())
            os._exit(INTERRUPTED)

        for kind in _ending_signals():
            signal.signal(kind, end)


def run_command(
    name: str, command: Callable[[], object], refusal: Callable[[Exception], str], interrupted: str = "interrupted"
) -> int:
    """Run a command; return its exit code, after one line if it did not succeed.

    Parameters
    ----------
    name : str
        What the line begins with.
    command : callable
    refusal : callable
        Returns the line of an expected error, or nothing. Errors of the operating system, such as a full disk, are
        expected as well.
    interrupted : str

    Returns
    -------
    int
        0, 2 after an expected error, 130 after Ctrl-C or SIGTERM, 141 if nobody reads the output any more.
    """
    received: list[int] = []

    def interrupt(kind: int, frame: object) -> NoReturn:
        received.append(kind)
        raise KeyboardInterrupt

    with handling(interrupt):
        try:
            try:
                command()
            finally:  # also after `--help`, which ends in SystemExit
                if sys.stdout:
                    sys.stdout.flush()
            return 0
        except BaseException as error:
            # Interrupted while it is imported, a library raises an error of its own.
            is_interrupt = received or isinstance(error, KeyboardInterrupt)
            code, line = (INTERRUPTED, interrupted) if is_interrupt else _ending(error, refusal)
            if not line:
                raise
            with handling(signal.SIG_IGN):
                _say_last(f"{name}: {line}")
            return code


def _ending(error: BaseException, refusal: Callable[[Exception], str]) -> tuple[int, str]:
    """Return the exit code and the line of an error; no line for an unexpected one."""
    if isinstance(error, BrokenPipeError):
        return UNREAD, "nobody reads its output any more"
    line = refusal(error) if isinstance(error, Exception) else ""
    if not line and isinstance(error, OSError):
        place = f"{error.filename}: " if error.filename is not None else ""
        line = f"{place}{error.strerror or str(error) or type(error).__name__}"
    return REFUSED, "".join(c if c.isprintable() else " " for c in line)


def _say_last(line: str) -> None:
    """Print the last line of a process; what its streams do not take is dropped, or Python would complain."""
    with suppress(OSError, ValueError):
        print(line, file=sys.stderr)
    for stream in filter(None, (sys.stdout, sys.stderr)):
        try:
            stream.flush()
        except (OSError, ValueError):
            with suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _ending_signals() -> list[signal.Signals]:
    """Return the signals that end a command; one that is ignored stays so, as after `nohup`."""
    return [k for k in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(k) not in (signal.SIG_IGN, None)]


@contextmanager
def handling(handler: Handler) -> Iterator[None]:
    """Handle the signals that end a command while the block runs."""
    before = {kind: signal.getsignal(kind) for kind in _ending_signals()}
    try:
        for kind in before:
            signal.signal(kind, handler)
        yield
    finally:
        for kind, own in before.items():
            signal.signal(kind, own)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Put Ctrl-C and SIGTERM off until the block has run: it takes a moment, and must be whole."""
    if threading.current_thread() is not threading.main_thread():  # only that one handles signals
        yield
        return
    received: list[int] = []
    try:
        with handling(lambda kind, frame: received.append(kind)):
            yield
    finally:
        for kind in received[:1]:
            signal.raise_signal(kind)
