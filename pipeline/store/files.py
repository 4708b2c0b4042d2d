"""Files and folders that appear whole or not at all."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pipeline.errors import ArtifactError


@contextmanager
def _disk_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        free = shutil.disk_usage(path.parent if path.parent.exists() else Path()).free
        reason = "the disk is full" if error.errno in (errno.ENOSPC, errno.EDQUOT) else error.strerror
        raise ArtifactError(
            f"{path}: cannot be written, {reason} ({free} bytes free); earlier artifacts are kept"
        ) from error


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file beside its place and rename it there.

    Raises
    ------
    ArtifactError
        If the disk is full or the place cannot be written.
    """
    partial = path.with_name(f".{path.name}.partial")
    with _disk_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            _write(partial, data)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)


def replace_folder(folder: Path, files: dict[str, bytes]) -> None:
    """Replace a folder by the given files: all of them, or the folder stays as it was.

    The new folder is written beside the old one and the two change names; what a killed run leaves behind is put
    right by `recover_folder`.

    Raises
    ------
    ArtifactError
        If the disk is full or the place cannot be written; the old folder is then untouched.
    """
    partial, old = _beside(folder, "partial"), _beside(folder, "old")
    with _disk_errors(folder):
        recover_folder(folder)
        try:
            for name, data in files.items():
                (partial / name).parent.mkdir(parents=True, exist_ok=True)
                _write(partial / name, data)
        except BaseException:
            shutil.rmtree(partial, ignore_errors=True)
            raise
        if folder.exists():
            folder.rename(old)
        partial.rename(folder)
        shutil.rmtree(old, ignore_errors=True)


def recover_folder(folder: Path) -> None:
    """Undo what a killed `replace_folder` left: drop the half-written folder, give a folder set aside its name back."""
    shutil.rmtree(_beside(folder, "partial"), ignore_errors=True)
    old = _beside(folder, "old")
    if old.exists() and not folder.exists():
        old.rename(folder)
    shutil.rmtree(old, ignore_errors=True)


def _beside(folder: Path, state: str) -> Path:
    return folder.with_name(f".{folder.name}.{state}")


def _write(path: Path, data: bytes) -> None:
    with path.open("wb") as stream:
        stream.write(data)
        stream.flush()
        os.fsync(stream.fileno())
