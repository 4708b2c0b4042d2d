"""Check a whole bundle: folder, hashes, record, model, and that they agree."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from minexplore.bundle import (
    MODEL,
    RECORD,
    UNSEALED,
    BundleError,
    has_visible_rock,
    is_volume,
    world_sha256,
)
from minexplore.floors.volume_arrays import VolumeArrays
from minexplore.schema.agreement import check_agreement
from minexplore.schema.elements import check_elements
from minexplore.schema.files import check_contents, is_known, read_folder
from minexplore.schema.light import LIGHT_WORLD
from minexplore.schema.model import WORLD
from minexplore.schema.readers.json_text import read_json
from minexplore.schema.readers.xml import read_xml
from minexplore.schema.record import check_record
from minexplore.schema.sizes import require_size
from minexplore.schema.volume.agreement import check_volume_model
from minexplore.schema.volume.arrays import read_volume
from minexplore.schema.volume.files import check_volume_files, require_volume_files
from minexplore.schema.volume.model import VOLUME_WORLD
from minexplore.schema.volume.record import check_figures, check_volume_record
from minexplore.schema.volume.rock import ROCK_VOLUME_WORLD, check_rock

__all__ = ["CheckedWorld", "check_files", "check_world", "hash_files", "read_folder"]


@dataclass(frozen=True)
class CheckedWorld:
    """A bundle that the tables allow: record, files by name as they were read, and the grid's arrays.

    A world that is one volume has its arrays, too; the grid's are made of its spans.
    """

    record: dict[str, Any]
    files: Mapping[str, bytes]
    grid: dict[str, np.ndarray]
    volume: VolumeArrays | None = None


def check_world(folder: Path) -> CheckedWorld:
    """Read a bundle once, and refuse it unless the tables allow all of it.

    Raises
    ------
    BundleError
        Naming the folder's file, the place in it, the value and what is wanted.
    """
    files = read_folder(folder)
    return check_files(folder, files, hash_files(files))


def hash_files(files: Mapping[str, bytes]) -> dict[str, str]:
    """Return the sha256 of each file."""
    return {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}


def check_files(folder: Path, files: Mapping[str, bytes], hashes: Mapping[str, str]) -> CheckedWorld:
    """Check a bundle's files, given by name with their hashes; see `check_world`. Nothing is read from the folder."""
    try:
        return _check(files, hashes)
    except BundleError as error:
        raise BundleError(f"{folder}/{error}") from error


def _check(files: Mapping[str, bytes], hashes: Mapping[str, str]) -> CheckedWorld:
    for name in filter(is_known, files):
        require_size(name, len(files[name]))
    record = read_json(RECORD, files.get(RECORD, b""))
    check_hashes(record, hashes)
    if is_volume(record):
        return _check_volume(record, files)
    check_record(RECORD, record)
    grid = check_contents(record, files)
    root = read_xml(MODEL, files[MODEL])
    check_elements(MODEL, root, WORLD if has_visible_rock(record) else LIGHT_WORLD)
    check_agreement(root, record, files)
    return CheckedWorld(record, files, grid)


def _check_volume(record: dict[str, Any], files: Mapping[str, bytes]) -> CheckedWorld:
    check_volume_record(record)
    require_volume_files(record, files)
    volume = read_volume(files)
    check_figures(record, volume)
    check_volume_files(record, files, volume)
    root = read_xml(MODEL, files[MODEL])
    check_elements(MODEL, root, ROCK_VOLUME_WORLD if has_visible_rock(record) else VOLUME_WORLD)
    check_volume_model(root, record, volume)
    if has_visible_rock(record):
        check_rock(root, record, files, volume)
    spans = volume.spans
    grid = {"clearance_m": spans.plan, "origin_m": spans.origin_m, "cell_m": np.array(spans.cell_m)}
    return CheckedWorld(record, files, grid, volume)


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
