"""What this project wrote in a folder: only that is removed, and anything else stops the command."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from pipeline.errors import ArtifactError
from pipeline.store.hashing import sha256_file

Written = Mapping[str, str | None]  # name below a folder -> sha256; None: a file of this name has any content


def written_files(folder: Path, ours: Written, sizes: Mapping[str, int] | None = None) -> dict[str, str]:
    """Return the sha256 of each file of a folder by its name; all of them must be ours.

    Parameters
    ----------
    folder : Path
        It need not exist.
    ours : mapping
        The files that a manifest states.
    sizes : mapping of str to int, optional
        Bytes of files whose writing may have been cut short: a shorter file of this name is ours, too.

    Raises
    ------
    ArtifactError
        Naming the first file, link or empty folder that is not listed, or file that differs from its hash.
    """
    if not os.path.lexists(folder):
        return {}
    if folder.is_symlink() or not folder.is_dir():
        raise ArtifactError(f"{folder}: a link or a file, where a folder is written; move it away and run again")
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_dir() and not path.is_symlink():
            if not any(listed.startswith(f"{name}/") for listed in ours):
                raise ArtifactError(_foreign(path, folder))
            continue
        if name not in ours or path.is_symlink() or not path.is_file():
            raise ArtifactError(_foreign(path, folder))
        found[name] = sha256_file(path)
        is_short = path.stat().st_size < (sizes or {}).get(name, 0)
        if ours[name] not in (None, found[name]) and not is_short:
            raise ArtifactError(
                f"{path}: was changed since it was written, and {folder} is replaced as a whole; move it away and run "
                "again"
            )
    return found


def remove_written(folder: Path, ours: Written) -> None:
    """Remove a folder whose files are all ours; see `written_files`.

    Raises
    ------
    ArtifactError
        If one is not; then nothing is removed.
    """
    for name in written_files(folder, ours):
        (folder / name).unlink()
    remove_empty(folder)


def remove_empty(folder: Path) -> None:
    """Remove a folder and those in it, as far as they hold no file."""
    if folder.is_dir() and not folder.is_symlink():
        for path in sorted(folder.rglob("*"), reverse=True):
            with suppress(OSError):  # a file, or a folder with one
                path.rmdir()
        with suppress(OSError):
            folder.rmdir()


def take_back(files: Mapping[Path, str], folders: Iterable[Path]) -> list[Path]:
    """Remove files that are as they were written, and then folders, the last one first, that hold nothing else.

    What cannot be removed hinders nothing else from being removed. The paths that stay are returned.
    """
    for file, digest in files.items():
        with suppress(OSError, ArtifactError):  # a file that was never written, and one that cannot be removed
            if not file.is_symlink() and sha256_file(file) == digest:
                file.unlink()
    made = list(folders)
    for folder in reversed(made):
        with suppress(OSError):  # not empty
            folder.rmdir()
    return [path for path in (*files, *made) if os.path.lexists(path)]


def _foreign(path: Path, folder: Path) -> str:
    return (
        f"{path}: no manifest of this project lists it, and {folder} is replaced as a whole; move it away and run again"
    )
