"""The expected errors, those of readers among them. Every message names the thing, the value and the limit."""

from __future__ import annotations

from collections.abc import Callable

from minesurveys.errors import GeometryError as GeometryError
from minesurveys.errors import InputError as InputError
from minesurveys.errors import MemoryShortageError as MemoryShortageError
from minesurveys.errors import MineError as MineError
from minesurveys.errors import ParamsError as ParamsError
from minesurveys.errors import describe_missing, describe_os_error, describe_shortage, lacks_memory


class ArtifactError(MineError):
    """An artifact is missing, broken, or different from its manifest."""


class LimitError(MineError):
    """A measured value breaches its limit in `conf/validation`."""


def run_command(name: str, command: Callable[[], object], interrupted: str = "interrupted") -> int:
    """Run a command; return its exit code, after one line if it did not succeed.

    The code is 2 after an expected error, 130 after Ctrl-C or SIGTERM, and 141 if nobody reads the output any more. An
    error of the operating system is expected as well: a file that may not be read, a folder that may not be written, a
    full disk, a name that is too long. The message names the file. So are a missing package and a lack of memory.
    """
    from minexplore import ends  # with Gymnasium, which the process that waits for another one does not need

    return ends.run_command(name, command, _refusal, interrupted)


def _refusal(error: Exception) -> str:
    """Return the line of an expected error; nothing for another one."""
    if isinstance(error, MineError):
        return str(error)
    if isinstance(error, OSError):
        return describe_os_error(error)
    if isinstance(error, ModuleNotFoundError):
        return describe_missing(error)
    return describe_shortage(error) if lacks_memory(error) else ""
