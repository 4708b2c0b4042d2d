"""Open a sealed bundle: its files, their hashes, and what an environment reads of them within limits."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from minexplore.bundle import (
    CLEARANCE_GRID,
    HFIELDS,
    MODEL,
    RECORD,
    ROCK_TEXTURE,
    UNSEALED,
    BundleError,
    has_visible_rock,
    is_volume,
    world_sha256,
)
from minexplore.sealed.arrays import read_arrays
from minexplore.sealed.files import is_known
from minexplore.sealed.json_text import read_json
from minexplore.sealed.model import check_names
from minexplore.sealed.png import GREY, PALETTE, RGB, check_png, image_blocks
from minexplore.sealed.record import check_record
from minexplore.sealed.sizes import MOST_CELLS, MOST_PIXELS, MOST_TILE_PIXELS, require_size

if TYPE_CHECKING:
    from minexplore.floors.volume_arrays import VolumeArrays

_GRID = {"free": ("|b1", 2), "clearance_m": ("<f4", 2), "origin_m": ("<f8", 1), "cell_m": ("<f8", 0)}


@dataclass(frozen=True)
class SealedWorld:
    """A bundle that is whole: record, files by name as they were read, and the grid's arrays.

    A world that is one volume has its arrays, too; the grid's are made of its spans.
    """

    record: dict[str, Any]
    files: Mapping[str, bytes]
    grid: dict[str, np.ndarray]
    volume: VolumeArrays | None = None


def hash_files(files: Mapping[str, bytes]) -> dict[str, str]:
    """Return the sha256 of each file."""
    return {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}


def open_files(folder: Path, files: Mapping[str, bytes], hashes: Mapping[str, str]) -> SealedWorld:
    """Open a bundle whose files were read from a folder, given by name with their hashes.

    Raises
    ------
    BundleError
        Naming the folder's file, the place in it, the value and what is wanted.
    """
    try:
        return _open(files, hashes)
    except BundleError as error:
        raise BundleError(f"{folder}/{error}") from error


def _open(files: Mapping[str, bytes], hashes: Mapping[str, str]) -> SealedWorld:
    for name in filter(is_known, files):
        require_size(name, len(files[name]))
    record = read_json(RECORD, files.get(RECORD, b""))
    check_hashes(record, hashes)
    check_record(record)
    for name in (MODEL, ROCK_TEXTURE) if has_visible_rock(record) else (MODEL,):
        if name not in files:
            raise BundleError(f"{name}: missing")
    check_names(files[MODEL], files)
    if ROCK_TEXTURE in files:
        _check_picture(ROCK_TEXTURE, files[ROCK_TEXTURE], (RGB, PALETTE), MOST_PIXELS[ROCK_TEXTURE])
    left_px = MOST_CELLS
    for name in sorted(name for name in files if name.startswith(HFIELDS)):
        left_px -= _check_picture(name, files[name], (GREY,), min(MOST_TILE_PIXELS, left_px))
    if not is_volume(record):
        return SealedWorld(record, files, _read_grid(files.get(CLEARANCE_GRID), record["world_m"]))
    from minexplore.sealed.volume import read_volume

    volume = read_volume(files)
    spans = volume.spans
    grid = {"clearance_m": spans.plan, "origin_m": spans.origin_m, "cell_m": np.array(spans.cell_m)}
    return SealedWorld(record, files, grid, volume)


def _check_picture(name: str, data: bytes, colours: tuple[int, ...], most_px: int) -> int:
    """Refuse a picture that MuJoCo would not unpack, or to more than its header says; return its pixels."""
    width, height = check_png(name, data, colours, most_px)
    for _ in image_blocks(name, data):
        pass
    return width * height


def check_hashes(record: Any, hashes: Mapping[str, str]) -> None:
    """Compare the files' hashes with those that the record states, and the record with the world's hash.

    Raises
    ------
    BundleError
        Naming the file that is missing, changed or not listed, or whose name leads out of the bundle.
    """
    listed = record.get("files") if isinstance(record, dict) else None
    if not isinstance(listed, dict) or not isinstance(record.get("world_sha256"), str):
        raise BundleError(f"{RECORD}: not a world bundle's record (files or world_sha256 missing)")
    for name, digest in sorted(listed.items()):
        if name.startswith(("/", "\\")) or ".." in re.split(r"[/\\]", name):
            raise BundleError(f"{RECORD}: the file name {name[:80]!r} leads out of the bundle")
        if not is_known(name) or name in UNSEALED:
            raise BundleError(f"{RECORD}: files: {name[:80]!r} is no file of a world")
        if name not in hashes:
            raise BundleError(f"{name}: missing")
        if hashes[name] != digest:
            raise BundleError(f"{name}: sha256 {hashes[name]} differs from {digest!r:.80} in {RECORD}")
    for name in hashes:
        if name not in listed and name not in UNSEALED:
            raise BundleError(f"{name}: not listed in {RECORD}")
    if world_sha256(record) != record["world_sha256"]:
        digest = record["world_sha256"][:80]
        raise BundleError(f"{RECORD}: the world's hash {digest} does not hold; the record was changed")


def _read_grid(data: bytes | None, world_m: list[float]) -> dict[str, np.ndarray]:
    """Return the arrays of the clearance grid: `free`, `clearance_m` (rows, cols), `origin_m` (2,), `cell_m`."""
    if data is None:
        raise BundleError(f"{CLEARANCE_GRID}: missing")
    grid = read_arrays(CLEARANCE_GRID, data, _GRID, MOST_CELLS)
    free, clearance, origin, cell = grid["free"], grid["clearance_m"], grid["origin_m"], float(grid["cell_m"])
    if not 0.05 <= cell <= 2 or origin.shape != (2,):
        raise BundleError(f"{CLEARANCE_GRID}: cell_m = {cell}, want 0.05 to 2")
    west, south = (float(np.floor(v / cell) * cell) for v in world_m[:2])
    shape = int(np.ceil((world_m[3] - south) / cell)), int(np.ceil((world_m[2] - west) / cell))
    if free.shape != shape or clearance.shape != shape or not np.abs(origin - [west, south]).max() <= 1e-9:
        raise BundleError(
            f"{CLEARANCE_GRID}: shapes {free.shape} and {clearance.shape} from {origin.tolist()} m; "
            f"world_m = {world_m} gives {shape} from {[west, south]}"
        )
    if not (clearance.min() >= 0 and clearance.max() < np.inf):
        raise BundleError(f"{CLEARANCE_GRID}: a clearance below 0 or not finite")
    return grid
