"""The table of the folder of a world that is one volume, and what its network and maps may hold."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from minexplore.bundle import (
    CELLS,
    FITTING_MESH,
    MADE_BY,
    MESHES,
    MODEL,
    NO_OVERLAY,
    OCTREE,
    PARTS,
    RECORD,
    ROUGH_MESH,
    TOPOLOGY,
    VOLUME,
    BundleError,
    has_visible_rock,
    storey_map,
)
from minexplore.floors.volume_arrays import VolumeArrays
from minexplore.sealed.json_text import read_json
from minexplore.sealed.png import GREY, check_png
from minexplore.sealed.sizes import MOST_CELLS
from pipeline.schema.files import VISIBLE, check_picture
from pipeline.schema.meshes import check_meshes
from pipeline.schema.png import inflate_png
from pipeline.schema.volume.network import check_network

_BEYOND_M = 1.0  # that visible rock reaches beyond the free space, at most
_MESH_FILE = re.compile(rf"{MESHES}(?:{ROUGH_MESH}|{FITTING_MESH})\.msh", re.ASCII)


def require_rock_files(record: Mapping[str, Any], files: Mapping[str, bytes]) -> set[str]:
    """Return the names of the files that show rock; refuse them in a world without, and a world that lacks them.

    Raises
    ------
    BundleError
        Naming the file.
    """
    found = {name for name in files if name in VISIBLE or _MESH_FILE.fullmatch(name)}
    if not has_visible_rock(record):
        for name in sorted(found):
            raise BundleError(
                f"{name}: no file of a world that is one volume, as {RECORD} says overlay = {NO_OVERLAY!r}"
            )
        return found
    missing = [name for name in VISIBLE if name not in found] or ([] if len(found) > len(VISIBLE) else [MESHES])
    if missing:
        raise BundleError(f"{missing[0]}: missing")
    return found


def check_rock(files: Mapping[str, bytes], volume: VolumeArrays) -> None:
    """Refuse meshes and a texture that no volume has.

    Raises
    ------
    BundleError
        Naming the file, the value and the limit.
    """
    vertices = volume.facets.vertices
    low, high = vertices.min(axis=0) - _BEYOND_M, vertices.max(axis=0) + _BEYOND_M
    check_meshes(files, low, high, volume.spans.heights_over, is_level=False)
    for name in VISIBLE:
        check_picture(name, files[name])


VOLUME_FILES = (CELLS, MODEL, OCTREE, PARTS, RECORD, TOPOLOGY, VOLUME)


def check_volume_files(record: Mapping[str, Any], files: Mapping[str, bytes], volume: VolumeArrays) -> None:
    """Refuse a network that a volume cannot have, and maps that are no pictures; stage 6 makes their pixels again.

    Raises
    ------
    BundleError
        Naming the file, the value and the limit.
    """
    check_network(record, read_json(TOPOLOGY, files[TOPOLOGY]), volume.facets)
    for storey in range(record["volume"]["storeys"]):
        _, picture = storey_map(storey)
        if picture in files:
            check_png(picture, files[picture], (GREY,), MOST_CELLS)
            inflate_png(picture, files[picture])


def require_volume_files(record: Mapping[str, Any], files: Mapping[str, bytes]) -> None:
    """Refuse a folder with other files than a volume's: those of `VOLUME_FILES`, its maps and rock, and who made it.

    Raises
    ------
    BundleError
        Naming the file.
    """
    for name in VOLUME_FILES:
        if name not in files:
            raise BundleError(f"{name}: missing")
    maps = {name for storey in range(min(record["volume"]["storeys"], 100)) for name in storey_map(storey)}
    known = {*VOLUME_FILES, MADE_BY, *maps, *require_rock_files(record, files)}
    for name in files:
        if name not in known:
            raise BundleError(f"{name}: no file of a world that is one volume, or a map of a storey that it has not")
