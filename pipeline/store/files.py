"""Write files and folders atomically: completely or not at all."""

from __future__ import annotations

import errno
import functools
import json
import os
import secrets
import shutil
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from minesurveys.errors import printable
from minexplore.ends import uninterrupted
from pipeline.errors import ArtifactError
from pipeline.store.hashing import read_text_file, sha256_bytes
from pipeline.store.written import Written, remove_empty, written_files

if TYPE_CHECKING:
    from pydantic import TypeAdapter, ValidationError

_JOURNAL, _NEW, _OLD = "journal.json", "new", "old"  # in the hidden folder beside one that is replaced
_WRITERS = 16  # each waits for the disk, which takes 200 files of one writer in 0.85 s and of 16 in 0.1 s


def adapter_of(kind: Any) -> TypeAdapter[Any]:
    """Return what reads and writes a type as JSON: to make one takes some milliseconds."""
    return _adapter_of(kind)


@functools.cache
def _adapter_of(kind: Any) -> TypeAdapter[Any]:
    from pydantic import TypeAdapter

    return TypeAdapter(kind)


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
    partial = path.with_name(f".{path.name}.{secrets.token_hex(4)}.partial")  # no file of the user has this name
    with _disk_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            _write(partial, data)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)


def write_report(path: Path, data: bytes) -> None:
    """Write figures as JSON to a path that the user chose; what is there must be figures with the same keys.

    Raises
    ------
    ArtifactError
        If there is anything else, or as `write_atomically`.
    """
    if os.path.lexists(path):
        try:
            earlier = json.loads(read_text_file(path))
        except (OSError, ArtifactError, ValueError, RecursionError):
            earlier = None
        if not isinstance(earlier, dict) or earlier.keys() != json.loads(data).keys():
            raise ArtifactError(f"{path}: there is another file; move it away, or give another name")
    write_atomically(path, data)


def replace_folder(folder: Path, files: Mapping[str, bytes], ours: Written) -> None:
    """Replace a folder by one with the given files, completely or not at all.

    The new folder is written into a hidden folder beside the old one, then both change places. A journal there lists
    the files of both, so that `recover_folder` repairs the state that a killed run leaves.

    Parameters
    ----------
    folder : Path
    files : mapping
        Content by name below the folder; a name that ends with a slash is that of an empty folder.
    ours : mapping
        What the old folder may hold: the files that its manifest states.

    Raises
    ------
    ArtifactError
        If the old folder holds anything else, the disk is full or the folder cannot be written; the old folder is then
        unchanged.
    """
    recover_folder(folder)
    work = _work_folder(folder)
    new, old = work / _NEW, work / _OLD
    with _disk_errors(folder), uninterrupted():  # a second; threads that write would go on after an interrupt
        before = written_files(folder, ours) | {name: "" for name in ours if name.endswith("/")}  # and empty folders
        _begin(work, {_NEW: {n: [sha256_bytes(data), len(data)] for n, data in files.items()}, _OLD: before})
        try:
            new.mkdir()
            named = [name for name in files if not name.endswith("/")]
            for name in files:
                (new / name if name not in named else (new / name).parent).mkdir(parents=True, exist_ok=True)
            with ThreadPoolExecutor(_WRITERS) as pool:
                for _ in pool.map(lambda name: _write(new / name, files[name]), named):
                    pass  # an error of a file is raised here
            if folder.exists():
                folder.rename(old)
            new.rename(folder)
        finally:
            recover_folder(folder)


def recover_folder(folder: Path) -> None:
    """Undo a killed `replace_folder`: give the old folder its name back, and remove what the journal lists.

    Raises
    ------
    ArtifactError
        If the hidden folder has no journal, or holds anything else.
    """
    work = _work_folder(folder)
    if not os.path.lexists(work):
        return
    new, old = work / _NEW, work / _OLD
    for empty in (new, old, work):  # a killed command may have left no more
        with suppress(OSError):
            empty.rmdir()
    if not os.path.lexists(work):
        return
    names = written_files(work, *_read_journal(work))
    if old.exists() and not folder.exists():
        old.rename(folder)
    for name in sorted(names, key=_JOURNAL.__eq__):  # the journal last
        (work / name).unlink(missing_ok=True)
    remove_empty(work)


def missing_folders(files: Iterable[Path]) -> list[Path]:
    """Return the folders of files that do not exist yet, each after the one that it lies in."""
    return sorted({folder for file in files for folder in file.parents if not folder.exists()})


def _work_folder(folder: Path) -> Path:
    return folder.with_name(f".{folder.name}.partial")


def _begin(work: Path, journal: dict[str, Any]) -> None:
    """Make the hidden folder with its journal."""
    work.mkdir(parents=True)
    try:
        _write(work / _JOURNAL, json.dumps(journal).encode())
    except BaseException:
        (work / _JOURNAL).unlink(missing_ok=True)
        work.rmdir()
        raise


def _read_journal(work: Path) -> tuple[dict[str, str | None], dict[str, int]]:
    """Return what the hidden folder may hold, and the sizes of files that may be cut short."""
    ours: dict[str, str | None] = {_JOURNAL: None}
    sizes: dict[str, int] = {}
    try:
        journal = json.loads(read_text_file(work / _JOURNAL))
        for name, (digest, size) in journal[_NEW].items():
            ours[f"{_NEW}/{name}"], sizes[f"{_NEW}/{name}"] = str(digest), int(size)
        ours |= {f"{_OLD}/{name}": str(digest) for name, digest in journal[_OLD].items()}
    except (OSError, ArtifactError, ValueError, TypeError, LookupError, AttributeError, RecursionError) as error:
        raise ArtifactError(
            f"{work}: this name is needed to write files, and what is there has no {_JOURNAL} of this project; move it "
            "away and run again"
        ) from error
    return ours, sizes


def _write(path: Path, data: bytes) -> None:
    with path.open("wb") as stream:
        stream.write(data)
        stream.flush()
        os.fsync(stream.fileno())
