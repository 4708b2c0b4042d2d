"""The expected errors of reading a survey. Every message names the thing, the value and the limit."""

from __future__ import annotations

import errno
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

_OURS = ("minesurveys", "minexplore", "pipeline", "stages")  # packages; a module that these lack is a fault of ours
_MOST_NAME = 300  # characters of a file's name in a message
_MOST_REASON = 200  # characters of a library's message
# A full disk, a quota, a limit on the size of files, and nobody who reads the output: nothing is wrong with the input.
_NO_RESOURCES = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EPIPE)
# How Python, C++, NumPy, MuJoCo, OpenCV and the loader of libraries state that memory or addresses ran out.
_NO_MEMORY = (
    *("bad_alloc", "ould not allocate", "annot allocate memory", "nable to allocate", "nsufficient memory"),
    *("ailed to allocate", "failed to map segment", "can't start new thread", "ut of memory"),
)


class MineError(Exception):
    """Base of all expected errors; a command prints the message and exits with code 2."""


class InputError(MineError):
    """An input file (plan, scale bar, survey, poses) cannot be used."""


class DoubtError(InputError):
    """A plan's workings are not found beyond doubt; `picture` (rows, cols, 3) uint8 shows what was found."""

    def __init__(self, message: str, picture: np.ndarray) -> None:
        super().__init__(message)
        self.picture = picture


class UnexpectedError(InputError):
    """A library raised an exception while it read a file, and the reader does not name that exception.

    `detail` is the library's exception, for developers; the message is for the person who has the file.
    """

    def __init__(self, subject: str, detail: str) -> None:
        super().__init__(
            f"{subject}: cannot be read: it is broken, or holds what its reader does not know; open it in the program "
            "that wrote it and save it again, or export it in another format that is read"
        )
        self.detail = detail


class ParamsError(MineError):
    """An override or a configuration value is unknown or out of range."""


class GeometryError(MineError):
    """A geometric precondition or invariant does not hold."""


class MemoryShortageError(MineError):
    """There is not enough memory; nothing is wrong with the input."""


def describe_missing(error: ModuleNotFoundError) -> str:
    """Return which package is not installed and the way on; nothing if a module of this project is missing."""
    if error.name is None or error.name.partition(".")[0] in _OURS:
        return ""
    return f"{error.name} is not installed for {sys.executable}; run `make setup`"


def lacks_resources(error: BaseException | None) -> bool:
    """Return whether an error is a lack of memory or of space, or a reader of the output that went away."""
    if lacks_memory(error):
        return True
    while error is not None:
        if isinstance(error, OSError) and error.errno in _NO_RESOURCES:
            return True
        error = error.__cause__
    return False


def lacks_memory(error: BaseException | None) -> bool:
    """Return whether an error is a lack of memory, or was raised from one."""
    while error is not None:
        ours = isinstance(error, MineError)  # whose text may quote a file
        if isinstance(error, MemoryError | MemoryShortageError):
            return True
        if isinstance(error, Exception) and not ours and any(text in str(error) for text in _NO_MEMORY):
            return True
        error = error.__cause__
    return False


def describe_shortage(error: BaseException) -> str:
    """Return a lack of memory as one printable line, with the limit on the process if it has one."""
    limit = ""
    with suppress(ImportError):  # Windows has no such limit
        import resource

        most = resource.getrlimit(resource.RLIMIT_AS)[0]
        limit = "" if most == resource.RLIM_INFINITY else f" within {most:,} bytes of addresses (`ulimit -v`)"
    reason = printable(str(error) or type(error).__name__, _MOST_REASON)
    return f"not enough memory{limit} ({reason})"


def printable(text: str, most: int) -> str:
    """Return a text of a library on one line without control characters, at most so many characters."""
    line = "".join(c if c.isprintable() else " " for c in " ".join(text.split()))
    return line if len(line) <= most else f"{line[:most]} ..."


def one_line(text: str, most: int = 600) -> str:
    """Return printable text on one line; a file's content cannot add lines or control a terminal."""
    clean = "".join(c if c.isprintable() else " " for c in text)
    return clean if len(clean) <= most else clean[: most - 3] + "..."


NAMED = 10  # things that a message names


def first_few(items: Sequence[str], between: str = ", ") -> str:
    """Return the first items in one line, and how many more there are."""
    more = f" and {len(items) - NAMED} more" if len(items) > NAMED else ""
    return between.join(items[:NAMED]) + more


def describe_os_error(error: OSError) -> str:
    """Return `FILE: reason`, on one printable line."""
    reason = error.strerror or str(error) or type(error).__name__
    if error.filename is None:
        return reason
    text = (
        f"{error.filename}: {reason}"
        if len(str(error.filename)) <= _MOST_NAME
        else f"{error.filename[:80]}...: {reason}"
    )
    return printable(text, 2 * _MOST_NAME)
