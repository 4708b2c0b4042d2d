"""The files of a bundle's folder: their names, and how many bytes each may have."""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path

from minexplore.bundle import (
    CELLS,
    CLEARANCE_GRID,
    FITTING_MESH,
    FOLDED_FLOOR,
    FREE_SPACE,
    HFIELDS,
    MADE_BY,
    MESHES,
    MODEL,
    NAV2_MAP,
    NAV2_PICTURE,
    OCTREE,
    PARTS,
    PREVIEW,
    RECORD,
    ROCK_TEXTURE,
    ROUGH_FLOORS,
    STOREY_MAPS,
    TOPOLOGY,
    VISIBLE_MESH,
    VOLUME,
    BundleError,
)
from minexplore.sealed.sizes import MOST_BUNDLE_BYTES, MOST_FILES, require_size

_FIXED = (
    *(CELLS, CLEARANCE_GRID, FREE_SPACE, MADE_BY, MODEL, NAV2_MAP, NAV2_PICTURE, OCTREE, PARTS, PREVIEW, RECORD),
    *(ROCK_TEXTURE, TOPOLOGY, VOLUME),
)
_NUMBERED = re.compile(
    rf"{MESHES}(?:{VISIBLE_MESH}|{FITTING_MESH})\.msh|{HFIELDS}{ROUGH_FLOORS}\.png|{STOREY_MAPS}", re.ASCII
)
_FOLDERS = {MESHES.rstrip("/"), HFIELDS.rstrip("/"), ROCK_TEXTURE.partition("/")[0]}


def is_known(name: str) -> bool:
    """Return whether a bundle may have a file of this name."""
    return name in _FIXED or bool(_NUMBERED.fullmatch(name))


def read_folder(folder: Path) -> dict[str, bytes]:
    """Return the files of a bundle by name; links, other kinds of files and unknown names are refused.

    Raises
    ------
    BundleError
        Naming the file.
    """
    record = folder / RECORD
    if not record.is_file():
        if folder.is_file():
            raise BundleError(f"{folder}: a file; a bundle is a folder, so unpack one that is packed")
        reason = "not a plain file" if record.exists() or record.is_symlink() else "missing; not a world bundle"
        raise BundleError(f"{record}: {reason}")
    files: dict[str, bytes] = {}
    total = 0
    for path, name in _walk(folder):
        if name == FOLDED_FLOOR:
            raise BundleError(f"{path}: of a world whose floor an older version folded; make the world again")
        if not is_known(name):
            raise BundleError(f"{path}: not listed in {RECORD}, and no file of a world has this name")
        try:
            data = read_bounded(path, name)
        except OSError as error:
            raise BundleError(f"{path}: cannot be read ({error.strerror})") from error
        total += len(data)
        if total > MOST_BUNDLE_BYTES or len(files) >= MOST_FILES:
            raise BundleError(f"{folder}: more than {MOST_BUNDLE_BYTES} bytes or {MOST_FILES} files")
        files[name] = data
    return files


def read_bounded(path: Path, name: str) -> bytes:
    """Return a file's bytes; its size is judged before it is read."""
    handle = os.open(path, os.O_RDONLY | sum(getattr(os, flag, 0) for flag in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY")))
    with os.fdopen(handle, "rb") as stream:
        try:
            size = os.fstat(stream.fileno()).st_size
            require_size(name, size)
            data = stream.read(size + 1)
        except BundleError as error:
            raise BundleError(f"{path}: {str(error).partition(': ')[2]}") from error
    if len(data) > size:
        raise BundleError(f"{path}: grew while it was read")
    return data


def _walk(folder: Path) -> list[tuple[Path, str]]:
    found: list[tuple[Path, str]] = []
    for path in _in_order(folder):
        kind = path.lstat().st_mode
        if stat.S_ISDIR(kind) and path.name in _FOLDERS:
            found += [(inner, f"{path.name}/{inner.name}") for inner in _in_order(path)]
        else:
            found.append((path, path.name))
    for path, _ in found:
        if not stat.S_ISREG(path.lstat().st_mode):
            raise BundleError(f"{path}: not a plain file; a world has no links, folders or devices here")
    return found


def _in_order(folder: Path) -> list[Path]:
    return sorted(folder.iterdir(), key=str)  # in one folder the order of paths, in a fifth of the time
