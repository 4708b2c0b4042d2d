"""Write files and folders atomically: completely or not at all."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.errors import ArtifactError, printable

if TYPE_CHECKING:
    from pydantic import ValidationError

_WRITERS = 16  # each waits for the disk, which takes 200 files of one writer in 0.85 s and of 16 in 0.1 s


def describe_field(error: ValidationError) -> str:
    """Return which field of an artifact is not as its schema wants, in our own words."""
    first = error.errors()[0]
    if first["type"] == "json_invalid":
        return "not JSON"
    place = printable(".".join(map(str, first["loc"])), 100)
    return f"{place!r} is missing, unknown or of another kind" if place else "its content is of another kind"


@contextmanager
def _disk_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        free = shutil.disk_usage(path.parent if path.parent.exists() else Path()).free
        reason = "the disk is full" if error.errno in (errno.ENOSPC, errno.EDQUOT) else error.strerror
        kept = "; the earlier one is kept" if path.exists() else ""
        raise ArtifactError(f"{path}: cannot be written, {reason} ({free} bytes free){kept}") from error


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file under a temporary name in its folder, then rename it.

    Raises
    ------
    ArtifactError
        If the disk is full or the file cannot be written.
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
    """Replace a folder by one with the given files, completely or not at all.

    The new folder is written next to the old one and takes its name. `recover_folder` repairs the state that a killed
    run leaves.

    Raises
    ------
    ArtifactError
        If the disk is full or the folder cannot be written; the old folder is then unchanged.
    """
    partial, old = _hidden_sibling(folder, "partial"), _hidden_sibling(folder, "old")
    with _disk_errors(folder):
        recover_folder(folder)
        try:
            for name in files:
                (partial / name).parent.mkdir(parents=True, exist_ok=True)
            with ThreadPoolExecutor(_WRITERS) as pool:
                for _ in pool.map(lambda name: _write(partial / name, files[name]), files):
                    pass  # an error of a file is raised here
        except BaseException:
            shutil.rmtree(partial, ignore_errors=True)
            raise
        if folder.exists():
            folder.rename(old)
        partial.rename(folder)
        shutil.rmtree(old, ignore_errors=True)


def missing_folders(files: Iterable[Path]) -> list[Path]:
    """Return the folders of files that do not exist yet, each after the one that it lies in."""
    return sorted({folder for file in files for folder in file.parents if not folder.exists()})


def take_back(files: Iterable[Path], folders: Iterable[Path]) -> list[Path]:
    """Remove files, and then folders, the last one first, that hold nothing else; return what stays."""
    for file in files:
        with suppress(OSError):  # a file that was never written, and one that cannot be removed
            file.unlink()
    made = list(folders)
    for folder in reversed(made):
        with suppress(OSError):  # not empty
            folder.rmdir()
    return [path for path in (*files, *made) if path.exists()]


def recover_folder(folder: Path) -> None:
    """Undo a killed `replace_folder`: delete the partial folder, and give a renamed old folder its name back."""
    shutil.rmtree(_hidden_sibling(folder, "partial"), ignore_errors=True)
    old = _hidden_sibling(folder, "old")
    if old.exists() and not folder.exists():
        old.rename(folder)
    shutil.rmtree(old, ignore_errors=True)


def _hidden_sibling(folder: Path, state: str) -> Path:
    return folder.with_name(f".{folder.name}.{state}")


def _write(path: Path, data: bytes) -> None:
    with path.open("wb") as stream:
        stream.write(data)
        stream.flush()
        os.fsync(stream.fileno())
