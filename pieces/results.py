"""Results by name in a folder or an object store; each is there whole, or not at all."""

from __future__ import annotations

import io
import secrets
import time
import zipfile
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

_TRIES, _FIRST_WAIT_S = 6, 0.1  # of a store that fails now and then; each wait is twice the one before
_HASH = 64  # characters of the hash before the content, by which half a file is known


class PiecesError(OSError):
    """Pieces that failed, or a place that cannot be used; commands end with its line and exit code 2."""


class Results:
    """The results of one kind of work at an address that fsspec knows."""

    def __init__(self, address: str, title: str) -> None:
        import fsspec  # loads slowly, and not every command keeps results

        try:
            self._files, root = fsspec.core.url_to_fs(address)
        except (ImportError, ValueError) as error:
            raise PiecesError(f"{address}: {error}") from error
        self._root, self._local = f"{root.rstrip('/')}/{title}", "file" in self._files.protocol

    def names(self) -> set[str]:
        """Return the names of all results."""
        self._files.invalidate_cache()
        return {path.rsplit("/", 1)[-1] for path in self._ask(lambda: self._files.ls(f"{self._root}/", False)) or ()}

    def read(self, name: str) -> bytes | None:
        """Return a result; None if it is not there, or not whole."""
        data = self._ask(lambda: self._files.cat_file(f"{self._root}/{name}")) or b""
        return data[_HASH:] if sha256(data[_HASH:]).hexdigest().encode() == data[:_HASH] else None

    def write(self, name: str, data: bytes) -> None:
        """Write a result, or replace it."""
        path, whole = f"{self._root}/{name}", sha256(data).hexdigest().encode() + data
        if not self._local:
            self._ask(lambda: self._files.pipe_file(path, whole))
            return
        part = Path(f"{self._root}/.{name}.{secrets.token_hex(4)}")  # its writer may be ended at any time
        part.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(whole)
        part.replace(path)

    def _ask(self, ask: Callable[[], Any]) -> Any:
        """Ask the store, again if it fails; None if there is no such result."""
        for tried in range(_TRIES):
            try:
                return ask()
            except FileNotFoundError:
                return None
            except Exception as error:  # each kind of store has errors of its own
                if self._local or tried == _TRIES - 1:
                    raise PiecesError(f"{self._root}: {type(error).__name__}: {error}") from error
                time.sleep(_FIRST_WAIT_S * 2**tried)


def packed(folder: Path) -> bytes:
    """Return a folder's files as one archive."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(folder.rglob("*")):
            archive.write(path, path.relative_to(folder))
    return data.getvalue()


def unpack(data: bytes, folder: Path) -> None:
    """Write an archive's files into a folder that is not there, whole or not at all."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=f".{folder.name}.", dir=folder.parent) as place:
        zipfile.ZipFile(io.BytesIO(data)).extractall(Path(place) / "fresh")
        (Path(place) / "fresh").rename(folder)
