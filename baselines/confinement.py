"""What a process gives up before it runs a stranger's code: memory, processor time, writing, network, other processes.

It uses the standard library only, as it must run before anything else starts a thread.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
from dataclasses import asdict, dataclass

# Linux's flags of `unshare` and `mount_setattr`, from <linux/sched.h> and <linux/mount.h>.
_NEW_MOUNTS, _NEW_IPC, _NEW_USER, _NEW_PROCESSES, _NEW_NETWORK = 0x20000, 0x08000000, 0x10000000, 0x20000000, 0x40000000
_MOUNT_SETATTR, _FROM_HERE, _RECURSIVE, _READ_ONLY = 442, -100, 0x8000, 1
_DIE_WITH_PARENT = 1  # of `prctl`
_OPEN_FILES = 256


@dataclass(frozen=True)
class Limits:
    """What a policy may use: memory of its process, and its own time over all its calls."""

    memory_bytes: int = 4 << 30
    time_s: float = 7200.0


@dataclass(frozen=True)
class Confinement:
    """What this system allowed to take away: the network, writing to files, and other processes' reach."""

    network: bool
    files: bool
    processes: bool

    def __str__(self) -> str:
        """Return what holds and what does not, as a sentence's part."""
        words = {"network": "without network", "files": "with read-only files", "processes": "alone among processes"}
        held = [words[name] for name, value in asdict(self).items() if value]
        open_ = [name for name, value in asdict(self).items() if not value]
        said = ", ".join(held) or "with limits on memory and time only"
        return said + (f" (this system does not let us take away: {', '.join(open_)})" if open_ else "")


class _MountAttributes(ctypes.Structure):
    _fields_ = [(name, ctypes.c_uint64) for name in ("set", "clear", "propagation", "user_namespace")]


def confine(limits: Limits) -> Confinement:
    """Give up what a policy does not need, for this process and all that it starts; nothing gives it back.

    Where the system allows new processes of its own, the caller goes on as the first of them.
    """
    import resource  # Unix only; the limits are read everywhere

    _limit(resource.RLIMIT_AS, limits.memory_bytes)
    _limit(resource.RLIMIT_CPU, int(limits.time_s) + 1)
    _limit(resource.RLIMIT_FSIZE, 0)
    _limit(resource.RLIMIT_CORE, 0)
    _limit(resource.RLIMIT_NOFILE, _OPEN_FILES)
    network = _unshare(_NEW_USER | _NEW_NETWORK)
    files = network and _unshare(_NEW_MOUNTS | _NEW_IPC) and _make_files_read_only()
    processes = network and _unshare(_NEW_PROCESSES)
    _die_with_parent()
    if processes:
        _go_on_as_child()
    return Confinement(network, files, processes)


def _limit(kind: int, most: int) -> None:
    import resource

    _, hard = resource.getrlimit(kind)
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(kind, (most, most))


def _unshare(flags: int) -> bool:
    """Return whether the system gave this process namespaces of its own."""
    try:
        return ctypes.CDLL(None).unshare(flags) == 0
    except (AttributeError, OSError):  # no Linux
        return False


def _make_files_read_only() -> bool:
    """Return whether all that is mounted became read-only for this process."""
    asked = _MountAttributes(set=_READ_ONLY)
    size = ctypes.sizeof(asked)
    return ctypes.CDLL(None).syscall(_MOUNT_SETATTR, _FROM_HERE, b"/", _RECURSIVE, ctypes.byref(asked), size) == 0


def _die_with_parent() -> None:
    """Have Linux end this process when the one that started it ends; elsewhere the closed pipes end it."""
    with contextlib.suppress(AttributeError, OSError):
        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)


def _go_on_as_child() -> None:
    """Fork; the child, first of its own processes, goes on, and this process ends when the child does."""
    child = os.fork()
    if child == 0:
        _die_with_parent()
        return
    _, status = os.waitpid(child, 0)
    os._exit(os.waitstatus_to_exitcode(status) & 0xFF)
