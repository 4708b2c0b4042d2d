"""Results by name in a folder or an object store; one that is not whole counts as none."""

from __future__ import annotations

import io
import shutil
import time
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from zipfile import ZipFile

_WAITS_S = (0.1, 0.2, 0.4, 0.8, 1.6)  # between the tries of a store that fails now and then
_HASH = 64  # characters of the hash before the content, by which half a file is known


class PiecesError(OSError):
    """Pieces that failed, or a place that cannot be used; commands end with its line and exit code 2."""


class Results:
    """Results at an address that fsspec knows."""

    def __init__(self, address: str) -> None:
        import fsspec  # loads slowly, and not every command keeps results

        self._files = fsspec.get_mapper(address)

    def read(self, name: str) -> bytes | None:
        """Return a result; None if it is not there, or not whole."""
        data = self._ask(lambda: self._files.get(name, b""))
        return data[_HASH:] if sha256(data[_HASH:]).hexdigest().encode() == data[:_HASH] else None

    def write(self, name: str, data: bytes) -> None:
        """Write a result, or replace it."""
        self._ask(lambda: self._files.update({name: sha256(data).hexdigest().encode() + data}))

    def write_folder(self, name: str, folder: Path) -> None:
        """Write a folder's files as one result."""
        with TemporaryDirectory() as place:
            self.write(name, Path(shutil.make_archive(f"{place}/packed", "zip", folder)).read_bytes())

    def read_folder(self, name: str, folder: Path) -> None:
        """Write what a result has of files into a folder that is not there, all or none."""
        if (data := self.read(name)) is None:
            raise PiecesError(f"{name}: is not there, or not whole")
        folder.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(prefix=f".{folder.name}.", dir=folder.parent) as place:
            ZipFile(io.BytesIO(data)).extractall(f"{place}/fresh")
            Path(place, "fresh").rename(folder)

    def _ask(self, ask: Callable[[], Any]) -> Any:
        for wait_s in (*_WAITS_S, None):
            try:
                self._files.fs.invalidate_cache()  # others write, too
                return ask()
            except Exception as error:  # each kind of store has errors of its own
                if wait_s is None or "file" in self._files.fs.protocol:
                    raise PiecesError(f"{self._files.root}: {type(error).__name__}: {error}") from error
                time.sleep(wait_s)
