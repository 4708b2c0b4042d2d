"""Read plain files within the limits of `minesurveys/limits.yaml`."""

from __future__ import annotations

from pathlib import Path

from minesurveys.errors import InputError, describe_os_error
from minesurveys.limits import FILE, reader_limits


def require_plain_file(path: Path) -> None:
    """Refuse a path that is no plain file, such as a folder, a pipe or a device, or that cannot be printed.

    Raises
    ------
    InputError
        The message names the path and what is there.
    """
    if not str(path).isprintable():
        raise InputError(f"{str(path)!r}: a path with line breaks, control characters or bytes that are no UTF-8")
    try:
        is_there, is_file = path.exists(), path.is_file()
    except OSError as error:
        raise InputError(describe_os_error(error)) from error
    if not is_file:
        raise InputError(f"{path}: {'not a plain file' if is_there else 'no such file'}")


def read_text_bytes(path: Path, limit: str = "text_bytes") -> bytes:
    """Return a text file's bytes, at most as many as the named limit of `minesurveys/limits.yaml`.

    Raises
    ------
    InputError
        If the file cannot be read or is larger.
    """
    most: int = getattr(reader_limits(), limit)
    try:
        with path.open("rb") as stream:
            data = stream.read(most + 1)
        if len(data) > most:
            raise InputError(f"{path}: {path.stat().st_size} bytes, the limit is {most} ({limit} in {FILE})")
        return data
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error


def require_at_most(path: Path, count: int, limit: str, noun: str) -> None:
    """Refuse a file with a count above the named limit of `minesurveys/limits.yaml`."""
    most: int = getattr(reader_limits(), limit)
    if count > most:
        raise InputError(f"{path}: {count} {noun}, the limit is {most} ({limit} in {FILE})")
