"""sha256 of files, folders and source closures."""

from __future__ import annotations

import ast
import functools
import hashlib
import re
import stat
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path

from pipeline.errors import ArtifactError

_MOST_TEXT = 16_000_000  # bytes; the largest, the manifest of a mine of 100 km, names a few thousand files


def sha256_bytes(data: bytes) -> str:
    """Return the hex sha256 of bytes."""
    return hashlib.sha256(data).hexdigest()


def sha256_file(path: Path) -> str:
    """Return the hex sha256 of a file, read in blocks.

    Raises
    ------
    ArtifactError
        If the file is missing, or is a folder, a pipe or a device.
    """
    require_plain(path)
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except FileNotFoundError:
        raise ArtifactError(f"{path}: missing") from None


def require_plain(path: Path) -> None:
    """Refuse what exists and is no file: a folder, or a pipe or a device, of which reading may never end.

    Raises
    ------
    ArtifactError
        Naming the path.
    """
    with suppress(FileNotFoundError, NotADirectoryError):  # one look: another process may remove the file between two
        if not stat.S_ISREG(path.stat().st_mode):
            raise ArtifactError(f"{path}: not a plain file")


def absence_of(path: Path) -> str:
    """Return how to state that a path is no file: it is `missing`, or something else is there, `not a plain file`."""
    return "not a plain file" if path.exists() else "missing"


def read_text_file(path: Path) -> bytes:
    """Return the content of a manifest, of figures or of parameters, which are small.

    Raises
    ------
    ArtifactError
        If it is no plain file, or larger than `_MOST_TEXT`.
    FileNotFoundError
        If it is missing.
    """
    require_plain(path)
    size = path.stat().st_size
    if size > _MOST_TEXT:
        raise ArtifactError(f"{path}: {size} bytes, want at most {_MOST_TEXT}")
    return path.read_bytes()


def sha256_named(hashes: dict[str, str]) -> str:
    """Return the sha256 of the sorted lines `sha256  name`, in the format of sha256sum."""
    return sha256_bytes("".join(f"{digest}  {name}\n" for name, digest in sorted(hashes.items())).encode())


def import_closure(module_file: Path, root: Path, ends: Collection[str] = ()) -> list[Path]:
    """List the sources of a module and of every project module that it imports, directly or indirectly.

    Imports inside functions and the `__init__.py` of packages are included.

    Parameters
    ----------
    module_file : Path
        A Python file below `root`.
    root : Path
        The project's folder; modules outside it are ignored.
    ends : collection of str, optional
        Sources, relative to `root`, whose own imports are left out.

    Returns
    -------
    list of Path
        Relative to `root`, sorted.
    """
    closure: set[str] = set()
    queue = [module_file.relative_to(root).as_posix()]
    while queue:
        source = queue.pop()
        if source not in closure:
            closure.add(source)
            queue += [] if source in ends else _imported_files(source, (root / source).read_text(), root)
    return sorted(map(Path, closure))


@functools.cache  # stages share most of their modules
def _imported_files(module: str, source: str, root: Path) -> list[str]:
    """Return the files below `root` that a module with a source imports, and the `__init__.py` of all packages."""
    names = [*_imported_names(source), ".".join(module.split("/")[:-1])]
    stems = ["/".join(parts[: k + 1]) for parts in (name.split(".") for name in names) for k in range(len(parts))]
    return [file for stem in dict.fromkeys(stems) if (file := _file_of(stem, root))]


@functools.cache
def _file_of(stem: str, root: Path) -> str | None:
    """Return the file below `root` of a module or package, given as a path without suffix; None for what is neither."""
    folder = stem.rpartition("/")[0]
    if folder and not _is_folder(folder, root):  # a name in a module, or in a package of others
        return None
    return next((file for file in (f"{stem}.py", f"{stem}/__init__.py") if (root / file).is_file()), None)


@functools.cache
def _is_folder(folder: str, root: Path) -> bool:
    return (root / folder).is_dir()


# A statement from its line on: up to the end of the line, or of the parentheses.
_IMPORT = re.compile(r"^[ \t]*((?:import|from)[ \t](?:[^(\n]*\([^)]*\)|(?:\\\n|[^\n])*))", re.MULTILINE)


_NAMED = re.compile(r'"([a-z_]\w*(?:\.\w+)+):\w+"')


@functools.cache  # of any root
def _imported_names(source: str) -> frozenset[str]:
    """Return the names that a source imports; only its import statements are parsed, which takes a tenth of the time.

    A line of a text that begins as an import does counts as one if it is Python. A text `module:function` names what is
    imported when it is needed.
    """
    names = set(_NAMED.findall(source))
    for match in _IMPORT.finditer(source):
        try:
            statements = ast.parse(match[1]).body
        except SyntaxError:  # prose
            continue
        for node in statements:
            if isinstance(node, ast.Import):
                names.update(alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
                names.add(node.module)
                names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return frozenset(names)
