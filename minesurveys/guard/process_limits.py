"""Restrict the process that reads a user's file."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

_PR_SET_PDEATHSIG, _M_ARENA_MAX = 1, -8
_SPARE_BYTES = 1_000_000_000


def has_limits() -> bool:
    """Return whether this system forks processes and limits them; Windows does neither."""
    return hasattr(os, "fork") and find_spec("resource") is not None


def die_with_parent(parent: int) -> None:
    """Ask the kernel to kill this process when its parent ends, also if the parent is killed (Linux)."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # the parent ended before the request
        os._exit(1)


def processor_s(pid: int) -> float:
    """Return the processor time of a process, and of its children that have ended, s; 0 if it is gone."""
    with suppress(OSError):
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()  # a name in front may have spaces
        return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")
    return 0.0


def restrict(memory_bytes: int, seconds: float, file_bytes: int = 0) -> None:
    """Limit this process: address space, processor time of all cores, no core dump, `file_bytes` in a written file.

    A forked process starts with its parent's address space. If that leaves less than 1 GB, 1 GB is granted.
    """
    import resource  # here and not above: Windows has no such module

    used = _address_space()
    _limit(resource.RLIMIT_AS, max(memory_bytes, used + _SPARE_BYTES))
    _limit(resource.RLIMIT_CPU, int(seconds * (os.cpu_count() or 1)) + 5)  # the parent may be gone
    _limit(resource.RLIMIT_CORE, 0)
    _limit(resource.RLIMIT_FSIZE, file_bytes)
    sys.dont_write_bytecode = True
    os.environ["GDAL_PAM_ENABLED"] = "NO"  # no `.aux.xml` beside the file is read or written
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, 2)  # each further arena would reserve 64 MB of address space


def _limit(kind: int, value: int) -> None:
    import resource

    hard = resource.getrlimit(kind)[1]
    value = value if hard == resource.RLIM_INFINITY else min(value, hard)
    resource.setrlimit(kind, (value, value))


def _address_space() -> int:
    with open("/proc/self/statm") as file:  # noqa: PTH123  before any limit, without imports
        return int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
