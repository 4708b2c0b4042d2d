"""The table of a bundle's folder: which files it has, and what the binary ones may hold."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from minexplore.bundle import (
    CELLS,
    CLEARANCE_GRID,
    FOLDED_FLOOR,
    FREE_SPACE,
    HFIELDS,
    MADE_BY,
    MESHES,
    MODEL,
    NAV2_MAP,
    NAV2_PICTURE,
    NO_OVERLAY,
    OCTREE,
    PARTS,
    PREVIEW,
    RECORD,
    ROCK_TEXTURE,
    ROUGH_FLOORS,
    STOREY_MAPS,
    TOPOLOGY,
    VOLUME,
    BundleError,
    has_visible_rock,
)
from minexplore.schema.agreement.rock import rock_box
from minexplore.schema.fittings import FITTING_MESH
from minexplore.schema.meshes import check_meshes
from minexplore.schema.model import VISIBLE_MESH
from minexplore.schema.readers.arrays import read_arrays
from minexplore.schema.readers.json_text import read_json
from minexplore.schema.readers.png import GREY, PALETTE, RGB, check_png, inflate_png
from minexplore.schema.readers.rules import numbers_in
from minexplore.schema.sizes import MOST_CELLS, MOST_PIXELS, require_size

FIXED = (
    CLEARANCE_GRID,
    FREE_SPACE,
    MODEL,
    NAV2_MAP,
    NAV2_PICTURE,
    OCTREE,
    PREVIEW,
    RECORD,
    ROCK_TEXTURE,
    TOPOLOGY,
)
VISIBLE = (PREVIEW, ROCK_TEXTURE)  # of these, only worlds with visible rock have any
_MESH = re.compile(rf"{MESHES}(?:{VISIBLE_MESH}|{FITTING_MESH})\.msh", re.ASCII)
_HFIELD = re.compile(rf"{HFIELDS}{ROUGH_FLOORS}\.png", re.ASCII)
_FOLDERS = {MESHES.rstrip("/"), HFIELDS.rstrip("/"), ROCK_TEXTURE.partition("/")[0]}
MOST_BUNDLE_BYTES = 1 << 30
_MOST_FILES = 100_000
PICTURES = {PREVIEW: (RGB,), NAV2_PICTURE: (GREY,), ROCK_TEXTURE: (RGB, PALETTE)}
_BEYOND_M = 1.0  # rough rock reaches a little beyond the box of the rock in plan
_BELOW_M, _ABOVE_M = 1.0, 5.0  # and so far below the floor and above the height
_GRID = {"free": ("|b1", 2), "clearance_m": ("<f4", 2), "origin_m": ("<f8", 1), "cell_m": ("<f8", 0)}
_MAP = re.compile(
    r"image: map\.png\nmode: trinary\nresolution: ([-0-9.e+]+)\norigin: \[([-0-9.]+), ([-0-9.]+), 0\.0\]\n"
    r"negate: 0\noccupied_thresh: 0\.65\nfree_thresh: 0\.25\n",
    re.ASCII,
)
_STOREY_MAP = re.compile(STOREY_MAPS, re.ASCII)


def is_known(name: str) -> bool:
    """Return whether a bundle may have a file of this name."""
    return name in (*FIXED, CELLS, PARTS, VOLUME, MADE_BY) or bool(
        _MESH.fullmatch(name) or _HFIELD.fullmatch(name) or _STOREY_MAP.fullmatch(name)
    )


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
        if total > MOST_BUNDLE_BYTES or len(files) >= _MOST_FILES:
            raise BundleError(f"{folder}: more than {MOST_BUNDLE_BYTES} bytes or {_MOST_FILES} files")
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


def check_contents(record: Mapping[str, Any], files: Mapping[str, bytes]) -> dict[str, np.ndarray]:
    """Refuse meshes, grid, map or pictures that a world cannot have; return the grid's arrays.

    Raises
    ------
    BundleError
        Naming the file, the value and the limit.
    """
    for name in files:
        if name in (CELLS, PARTS, VOLUME) or _STOREY_MAP.fullmatch(name):
            raise BundleError(f"{name}: only a world that is one volume has such a file")
    for name in FIXED:
        if name not in files and not (name in VISIBLE and not has_visible_rock(record)):
            raise BundleError(f"{name}: missing")
    if not has_visible_rock(record):
        _refuse_visible(files)
    low, high = rock_box(record)
    low, high = low - [_BEYOND_M, _BEYOND_M, _BELOW_M], high + np.array([_BEYOND_M, _BEYOND_M, _ABOVE_M])
    check_meshes(files, low, high)
    for name, kind in _fixed_pictures(record).items():
        width, height = check_png(name, files[name], kind, MOST_PIXELS[name])
        inflate_png(name, files[name])
        if name == ROCK_TEXTURE and (width != height or width < 16):
            raise BundleError(f"{name}: {width} x {height} px, want a square of 16 px or more")
        if name == PREVIEW and not 64 <= width <= 4096:
            raise BundleError(f"{name}: {width} x {height} px, want a width of 64 to 4096 px")
    _check_map(files[NAV2_MAP])
    grid = _read_checked_grid(files[CLEARANCE_GRID], record["world_m"])
    for name in (FREE_SPACE, TOPOLOGY):
        read_json(name, files[name])
    return grid


def _fixed_pictures(record: Mapping[str, Any]) -> dict[str, tuple[int, ...]]:
    return {name: kind for name, kind in PICTURES.items() if has_visible_rock(record) or name not in VISIBLE}


def _refuse_visible(files: Mapping[str, bytes]) -> None:
    for name in files:
        if name in VISIBLE or name.startswith((MESHES, HFIELDS)):
            raise BundleError(f"{name}: {RECORD} says overlay = {NO_OVERLAY!r}; such a world has no file of this kind")


def read_grid(data: bytes) -> dict[str, np.ndarray]:
    """Return the arrays of the clearance grid: `free`, `clearance_m` (rows, cols), `origin_m` (2,), `cell_m`.

    The sizes are read before anything is unpacked.

    Raises
    ------
    BundleError
        If it is no archive of these arrays, or too large.
    """
    return read_arrays(CLEARANCE_GRID, data, _GRID, MOST_CELLS)


def _read_checked_grid(data: bytes, world_m: list[float]) -> dict[str, np.ndarray]:
    grid = read_grid(data)
    free, clearance, origin, cell = grid["free"], grid["clearance_m"], grid["origin_m"], float(grid["cell_m"])
    if not 0.05 <= cell <= 2 or origin.shape != (2,):
        raise BundleError(f"{CLEARANCE_GRID}: cell_m = {cell}, want 0.05 to 2")
    west, south = (float(np.floor(v / cell) * cell) for v in world_m[:2])
    shape = int(np.ceil((world_m[3] - south) / cell)), int(np.ceil((world_m[2] - west) / cell))
    if free.shape != shape or clearance.shape != shape or np.abs(origin - [west, south]).max() > 1e-9:
        raise BundleError(
            f"{CLEARANCE_GRID}: shapes {free.shape} and {clearance.shape} from {origin.tolist()} m; "
            f"world_m = {world_m} gives {shape} from {[west, south]}"
        )
    if free.view(np.uint8).max() > 1 or not (clearance.min() >= 0 and clearance.max() < np.inf):
        raise BundleError(
            f"{CLEARANCE_GRID}: a clearance below 0 or not finite, or a cell that is neither true nor false"
        )
    if clearance[~free].any():
        raise BundleError(f"{CLEARANCE_GRID}: a clearance above 0 in rock")
    return grid


def _check_map(data: bytes) -> None:
    found = _MAP.fullmatch(data.decode("ascii", "replace"))
    if found is None or any(numbers_in(value) is None for value in found.groups()):
        raise BundleError(
            f"{NAV2_MAP}: want image: {NAV2_PICTURE}, mode, resolution, origin, negate and the two thresholds only"
        )
