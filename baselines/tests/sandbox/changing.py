"""A policy that tries to change, lock and watch all that it sees, and what of it is different outside."""

import contextlib
import ctypes
import fcntl
import hashlib
import os
import stat
import struct
from pathlib import Path

import numpy as np

libc = ctypes.CDLL(None, use_errno=True)
libc.syscall.restype = ctypes.c_long
held = []  # open files: a lock ends with its file


def call(number, *words):
    found = libc.syscall(ctypes.c_long(number), *(ctypes.c_long(w) if isinstance(w, int) else w for w in words))
    if found < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return found


def mode_of(path):
    return stat.S_IMODE(os.stat(path).st_mode)  # noqa: PTH116


def times_of(path):
    return os.stat(path).st_atime_ns, os.stat(path).st_mtime_ns  # noqa: PTH116


def is_plain(path):
    return stat.S_ISREG(os.stat(path).st_mode)  # noqa: PTH116


def open_to_write(path, place):
    if not is_plain(path):
        raise OSError("only a plain file has content")
    os.close(os.open(place, os.O_WRONLY))


def lock(file, command, kind):
    fcntl.fcntl(file, command, struct.pack("hhqqi4x", kind, 0, 0, 0, 0))


def notify(path, file):
    if not os.path.isdir(path):  # noqa: PTH112
        raise OSError("only a folder notifies")
    fcntl.fcntl(file, fcntl.F_NOTIFY, 1)


def watch(path):
    watcher = call(294, 0)  # inotify_init1
    try:
        call(254, watcher, os.fsencode(path), 2)  # inotify_add_watch, IN_MODIFY
    finally:
        os.close(watcher)


def set_flags(file):
    flags = ctypes.c_long()
    if libc.ioctl(file, ctypes.c_ulong(0x80086601), ctypes.byref(flags)):  # FS_IOC_GETFLAGS
        raise OSError(ctypes.get_errno(), "no flags")
    fcntl.ioctl(file, 0x40086602, flags)  # FS_IOC_SETFLAGS


# Each changes nothing that a user would miss, so that a sandbox that lets it through does no harm here.
ATTEMPTS = {
    "mode": lambda path, file: os.chmod(path, mode_of(path)),  # noqa: PTH101
    "mode of an open file": lambda path, file: os.fchmod(file, mode_of(path)),
    "mode through proc": lambda path, file: os.chmod(f"/proc/self/fd/{file}", mode_of(path)),  # noqa: PTH101
    "mode by the newer call": lambda path, file: call(452, -100, os.fsencode(path), mode_of(path), 0),
    "owner": lambda path, file: os.chown(path, os.getuid(), os.getgid()),
    "owner of an open file": lambda path, file: os.fchown(file, os.getuid(), os.getgid()),
    "no owner": lambda path, file: os.lchown(path, -1, -1),
    "times": lambda path, file: os.utime(path, ns=times_of(path)),
    "times of an open file": lambda path, file: os.utime(file, ns=times_of(path)),
    "times now": lambda path, file: os.utime(path),
    "times by the older call": lambda path, file: call(235, os.fsencode(path), 0),
    "attribute": lambda path, file: os.setxattr(path, "user.policy", b""),
    "attribute of an open file": lambda path, file: os.setxattr(file, "user.policy", b""),
    "attribute removed": lambda path, file: os.removexattr(path, "user.policy"),
    "flags": lambda path, file: set_flags(file),
    "open to write": lambda path, file: open_to_write(path, path),
    "open to write through proc": lambda path, file: open_to_write(path, f"/proc/self/fd/{file}"),
    "lock of a file": lambda path, file: fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB),
    "shared lock of a file": lambda path, file: fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB),
    "lock of a process": lambda path, file: lock(file, fcntl.F_SETLK, fcntl.F_RDLCK),
    "lock of an open file": lambda path, file: lock(file, fcntl.F_OFD_SETLK, fcntl.F_RDLCK),
    "lease": lambda path, file: fcntl.fcntl(file, fcntl.F_SETLEASE, fcntl.F_RDLCK),
    "notified": lambda path, file: notify(path, file),
    "watched": lambda path, file: watch(path),
}
HELD = [name for name in ATTEMPTS if "lock" in name or name == "lease"]


def gained(name, path):
    """Return whether an attempt succeeds; the file of a lock stays open."""
    try:
        file = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        ATTEMPTS[name](path, file)
    except OSError:
        os.close(file)
        return False
    if name in HELD:
        held.append(file)
    else:
        os.close(file)
    return True


def with_children(paths):
    """Return paths, and what the folders among them hold."""
    children = [str(inner) for path in paths if os.path.isdir(path) for inner in Path(path).iterdir()]  # noqa: PTH112
    return sorted({*paths, *children})


class Changes:
    """Drives by how many paths each attempt gained something on, and how many were tried."""

    def __init__(self, count, task, robot):
        """Take the number of attempts."""
        self.count = count

    def reset(self, robots, seeds):
        """Have nothing to begin."""

    def act(self, observation, info):
        """Try all."""
        mounts = [line.split()[4] for line in Path("/proc/self/mountinfo").read_text().splitlines()]
        below = [str(path) for place in ("/project", "/policy") for path in Path(place).rglob("*.py")]
        paths = [*with_children([*mounts, "/policy", "/project", "/tmp"]), *below[:200]]
        return np.array([[sum(gained(name, path) for path in paths), len(paths)] for name in ATTEMPTS], float)


def describe(path):
    """Return what a path's inode states, and its content."""
    about = os.lstat(path)
    with contextlib.suppress(OSError):
        file = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW)
        with os.fdopen(file, "rb") as stream:
            content = hashlib.sha256(stream.read(1 << 20)).hexdigest() if stat.S_ISREG(about.st_mode) else ""
        read_ns = about.st_atime_ns if stat.S_ISCHR(about.st_mode) else 0  # others read plain files meanwhile
        names = os.listxattr(path, follow_symlinks=False)
        return (
            (about.st_mode, about.st_uid, about.st_gid, read_ns, about.st_mtime_ns, about.st_ctime_ns),
            content,
            names,
        )
    return about.st_mode, about.st_uid, about.st_gid, about.st_mtime_ns, about.st_ctime_ns


def blocked(path):
    """Return what keeps a user from locking a path or writing to it."""
    try:
        try:
            file = os.open(path, os.O_RDWR | os.O_NONBLOCK)
        except BlockingIOError:
            return "a lease"
        except OSError:
            file = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        with os.fdopen(file, "rb", buffering=0) as stream:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            is_writable = fcntl.fcntl(stream, fcntl.F_GETFL) & os.O_RDWR
            fcntl.lockf(stream, (fcntl.LOCK_EX if is_writable else fcntl.LOCK_SH) | fcntl.LOCK_NB)
    except BlockingIOError:
        return "a lock"
    except OSError:  # it may not be opened, whoever holds it
        return ""
    return ""
