"""The files that a stranger's policy consists of: copied and hashed before anything of it runs or is imported."""

from __future__ import annotations

import hashlib
import importlib.machinery
import os
import sys
from pathlib import Path

from baselines.base.errors import BaselineError
from minexplore.limits import UnreadableError, read_plain_file, require_small_json

_MOST_FILES = 2000  # of a package
MOST_BYTES = 256_000_000  # of all files, weights included; a checkpoint may have as much
_SIZE = 8  # bytes of a safetensors file that state its header's size
_MOST_HEADER, _MOST_HEADER_VALUES, _DEEPEST_HEADER = 1_000_000, 20_000, 3  # of kept policies: 3 kB, 100, 3
_MOST_NAME = 200  # characters of a name in a message


def find_source(module: str) -> Path:
    """Return the file or the package's folder of a top-level module, without importing it.

    Raises
    ------
    BaselineError
        If there is none in the working folder or on the path.
    """
    spec = importlib.machinery.PathFinder.find_spec(module, [str(Path.cwd()), *sys.path])
    if spec is not None and spec.submodule_search_locations:
        return Path(next(iter(spec.submodule_search_locations)))
    if spec is not None and spec.origin is not None and Path(spec.origin).is_file():
        return Path(spec.origin)
    raise BaselineError(f"policy: cannot be imported (no module named {module[:_MOST_NAME]!r})")


def read_source(source: Path) -> dict[str, bytes]:
    """Return the contents of a module's file, or of all files of a package, by their path in the folder above.

    Raises
    ------
    BaselineError
        If there are too many or too large files, or one is a link or no plain file.
    """
    paths = [source] if source.is_file() else sorted(_files_below(source))
    found, left = {}, MOST_BYTES
    for path in paths:
        content = read_plain(path, left)
        found[path.relative_to(source.parent).as_posix()] = content
        left -= len(content)
    return found


def read_plain(path: Path, most_bytes: int = MOST_BYTES) -> bytes:
    """Return the bytes of a plain file that is no link.

    Raises
    ------
    BaselineError
        If it is something else, cannot be read, or is longer than `most_bytes`.
    """
    try:
        return read_plain_file(path, most_bytes, may_link=False)
    except UnreadableError as error:
        raise BaselineError(f"{path}: {error}") from error


def require_checkpoint(path: Path) -> bytes:
    """Return the bytes of a checkpoint, a link or a plain file, whose header is small enough to be read.

    Raises
    ------
    BaselineError
        If it is something else, cannot be read, or is too large.
    """
    try:
        content = read_plain_file(path, MOST_BYTES)
        header = content[_SIZE : _SIZE + int.from_bytes(content[:_SIZE], "little")]
        if len(header) > _MOST_HEADER:
            raise UnreadableError(f"a header of {len(header):,} bytes, at most {_MOST_HEADER:,} are read")
        require_small_json(header, _MOST_HEADER_VALUES, _MOST_HEADER_VALUES, _DEEPEST_HEADER)
    except UnreadableError as error:
        raise BaselineError(f"{path}: {error}") from error
    return content


def source_sha256(files: dict[str, bytes]) -> str:
    """Return the hash of files with their paths."""
    found = hashlib.sha256()
    for name, content in sorted(files.items()):
        path = os.fsencode(name)
        found.update(b"%d %s %d %s" % (len(path), path, len(content), content))
    return found.hexdigest()


def write_source(files: dict[str, bytes], folder: Path) -> None:
    """Write files below a folder."""
    for name, content in files.items():
        place = folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content)


def _files_below(folder: Path) -> list[Path]:
    """Return all files of a package but compiled copies of its modules."""
    found: list[Path] = []
    entries = 0
    for parent, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if name != "__pycache__"]
        linked = [name for name in folders if Path(parent, name).is_symlink()]
        if linked:
            raise BaselineError(f"{Path(parent, linked[0])}: a link, a policy's package holds plain files and folders")
        found += [Path(parent, name) for name in names]
        entries += len(names) + len(folders)
        if entries > _MOST_FILES:
            raise BaselineError(f"{folder}: more than {_MOST_FILES} files and folders, the most of a policy's package")
    return found
