"""The table of the folder of a world that is one volume, and what its network and maps may hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from minexplore.bundle import (
    CELLS,
    MADE_BY,
    MODEL,
    OCTREE,
    PARTS,
    RECORD,
    TOPOLOGY,
    VOLUME,
    BundleError,
    storey_map,
)
from minexplore.floors.volume_arrays import VolumeArrays
from minexplore.sealed.json_text import read_json
from minexplore.sealed.png import GREY, check_png
from minexplore.sealed.sizes import MOST_CELLS
from pipeline.schema.readers.png import inflate_png
from pipeline.schema.volume.network import check_network
from pipeline.schema.volume.rock import require_rock_files

VOLUME_FILES = (CELLS, MODEL, OCTREE, PARTS, RECORD, TOPOLOGY, VOLUME)


def check_volume_files(record: Mapping[str, Any], files: Mapping[str, bytes], volume: VolumeArrays) -> None:
    """Refuse a network that a volume cannot have, and pictures of maps that are none; what they show is made again.

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
