"""The table of the folder of a world that is one volume, and what its maps and texts may hold."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

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
from minexplore.floors.volume_arrays import FloorSpans, VolumeArrays
from minexplore.sealed.json_text import read_json
from minexplore.sealed.png import GREY, check_png
from minexplore.sealed.sizes import MOST_CELLS
from pipeline.schema.readers.png import inflate_png
from pipeline.schema.readers.rules import numbers_in
from pipeline.schema.volume.network import check_network
from pipeline.schema.volume.rock import require_rock_files

VOLUME_FILES = (CELLS, MODEL, OCTREE, PARTS, RECORD, TOPOLOGY, VOLUME)
_OCTREE_BEGINS = b"# Octomap OcTree binary file\n"
_MAP = re.compile(
    r"# storey (\d+): floor ([-0-9.]+) to ([-0-9.]+) m high\n"
    r"image: (map_\d+\.png)\nmode: trinary\nresolution: ([-0-9.e+]+)\norigin: \[([-0-9.]+), ([-0-9.]+), 0\.0\]\n"
    r"negate: 0\noccupied_thresh: 0\.65\nfree_thresh: 0\.25\n",
    re.ASCII,
)


def check_volume_files(record: Mapping[str, Any], files: Mapping[str, bytes], volume: VolumeArrays) -> None:
    """Refuse files that a volume has not, or maps and a network that it cannot have.

    Raises
    ------
    BundleError
        Naming the file, the value and the limit.
    """
    _check_octree(files[OCTREE])
    spans = volume.spans
    check_network(record, read_json(TOPOLOGY, files[TOPOLOGY]), volume.facets)
    for storey in range(record["volume"]["storeys"]):
        name, picture = storey_map(storey)
        if (name in files) != (picture in files):
            raise BundleError(f"{name if picture in files else picture}: missing; a map has a text and a picture")
        if name in files:
            _check_map(storey, name, files[name], spans)
            size, wanted = check_png(picture, files[picture], (GREY,), MOST_CELLS), _size_of(spans, storey)
            if size != wanted:
                raise BundleError(f"{picture}: {size[0]} x {size[1]} px, want {wanted[0]} x {wanted[1]}")
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


def _check_octree(data: bytes) -> None:
    if not data.startswith(_OCTREE_BEGINS):
        raise BundleError(f"{OCTREE}: not a binary octree of OctoMap")


def _size_of(spans: FloorSpans, storey: int) -> tuple[int, int]:
    """Return the width and height, cells, of a storey's map, which has a cell round it."""
    own = spans.storey == storey
    width, height = (int(np.ptp(axis[own])) + 3 for axis in (spans.column, spans.row))
    return width, height


def _check_map(storey: int, name: str, data: bytes, spans: FloorSpans) -> None:
    found = _MAP.fullmatch(data.decode("ascii", "replace"))
    number, low, high, image, *values = found.groups() if found else (None,) * 5
    numbers = [value for value in (low, high, *values) if value is not None]
    if image != storey_map(storey)[1] or number != str(storey) or any(numbers_in(value) is None for value in numbers):
        raise BundleError(
            f"{name}: want a remark on storey {storey}, image: {storey_map(storey)[1]}, mode, resolution, origin, "
            "negate and the two thresholds only"
        )
    if not (spans.storey == storey).any():
        raise BundleError(f"{name}: a map of storey {storey}, which has no floor")
