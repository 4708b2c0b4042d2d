"""Locks between processes. The system releases a lock when its process ends, so a lock cannot go stale."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from pipeline.errors import ArtifactError
from pipeline.store.hashing import read_text_file

_LOCK = re.compile(rb"(\d{1,19}\n)?")  # what a lock file holds: its process


@contextmanager
def hold_lock(path: Path, busy: str | None) -> Iterator[None]:
    """Hold a lock file while the block runs, then remove it. The file states the holder's process number.

    Without `busy` it waits for other holders.

    Raises
    ------
    ArtifactError
        If another process holds the lock: `busy`, with that process's number. If there is a file of this name that is
        no lock.
    """
    _require_lock(path)
    made = _make_folders(path.parent)
    # A file system without locks would get a file that outlives its process, so it is an error here.
    lock = FileLock(path, blocking=busy is None, fallback_to_soft=False, on_acquired=_state_process)
    try:
        try:
            lock.acquire()
        except Timeout:
            with suppress(OSError):
                busy = f"{busy} (process {path.read_text().strip() or 'unknown'})"
            raise ArtifactError(busy) from None
        try:
            yield
        finally:
            with suppress(OSError):  # Windows removes no open file
                path.unlink()  # before the release, so that nobody locks a file that is then removed
            lock.release()
    finally:
        for folder in reversed(made):
            with suppress(OSError):  # another process uses it
                folder.rmdir()


def _require_lock(path: Path) -> None:
    """Refuse a file that holds anything but a process number: it would be emptied and removed."""
    with suppress(FileNotFoundError):
        if path.is_symlink() or (path.lstat().st_size and not _LOCK.fullmatch(read_text_file(path))):
            raise ArtifactError(f"{path}: this name is needed for a lock, and what is there is none; move it away")


def _state_process(descriptor: int) -> None:
    os.ftruncate(descriptor, 0)
    os.write(descriptor, f"{os.getpid()}\n".encode())


def _make_folders(folder: Path) -> list[Path]:
    """Make a folder and its parents, and return those that did not exist."""
    missing = [place for place in (folder, *folder.parents) if not place.exists()][::-1]
    folder.mkdir(parents=True, exist_ok=True)
    return missing
