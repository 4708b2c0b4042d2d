"""Locks between processes. The kernel releases a lock when its process ends, so a lock cannot go stale.

Windows has no such locks: commands warn of that, and run without.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from pipeline.errors import ArtifactError


@contextmanager
def hold_lock(path: Path, busy: str | None) -> Iterator[None]:
    """Hold a lock file while the block runs, then remove it. The file states the holder's process number.

    Without `busy` it waits for other holders.

    Raises
    ------
    ArtifactError
        If another process holds the lock: `busy`, with that process's number.
    """
    if not _has_locks():
        yield
        return
    made = _make_folders(path.parent)
    try:
        descriptor = _open_locked(path, wait=busy is None)
        if descriptor is None:
            with suppress(OSError):
                busy = f"{busy} (process {path.read_text().strip() or 'unknown'})"
            raise ArtifactError(busy)
        try:
            os.ftruncate(descriptor, 0)
            os.write(descriptor, f"{os.getpid()}\n".encode())
            yield
        finally:
            path.unlink(missing_ok=True)  # before the release, so that nobody locks a file that is then removed
            os.close(descriptor)
    finally:
        for folder in reversed(made):
            with suppress(OSError):  # another process uses it
                folder.rmdir()


@contextmanager
def wait_for_lock(path: Path) -> Iterator[None]:
    """Hold a lock on an existing file while the block runs; wait for other holders. The block may replace the file."""
    if not _has_locks():
        yield
        return
    descriptor = _open_locked(path, wait=True)
    assert descriptor is not None
    try:
        yield
    finally:
        os.close(descriptor)


@cache
def _has_locks() -> bool:
    """Return whether this system has locks of files; warn once if it has none."""
    has = find_spec("fcntl") is not None
    if not has:
        print("this system has no locks of files: run one command at a time in this folder", file=sys.stderr)
    return has


def _open_locked(path: Path, wait: bool) -> int | None:
    """Open and lock a file; None if another process holds it and `wait` is false."""
    import fcntl  # here and not above: Windows has no such module

    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            os.close(descriptor)
            return None
        except BaseException:
            os.close(descriptor)
            raise
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(descriptor), path.stat()):
                return descriptor
        os.close(descriptor)  # its last holder removed or replaced it


def _make_folders(folder: Path) -> list[Path]:
    """Make a folder and its parents, and return those that did not exist."""
    missing = [place for place in (folder, *folder.parents) if not place.exists()][::-1]
    folder.mkdir(parents=True, exist_ok=True)
    return missing
