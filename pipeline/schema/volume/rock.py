"""What shows the visible rock of a volume: its meshes and its texture."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from minexplore.bundle import (
    FURNITURE_MESH,
    MESHES,
    NO_OVERLAY,
    RECORD,
    ROCK_TEXTURE,
    ROUGH_MESH,
    BundleError,
    has_visible_rock,
)
from minexplore.floors.volume_arrays import VolumeArrays
from minexplore.sealed.png import PALETTE, RGB, check_png
from minexplore.sealed.sizes import MOST_PIXELS
from pipeline.schema.meshes import check_meshes
from pipeline.schema.readers.png import inflate_png

_BEYOND_M = 1.0  # that visible rock reaches beyond the free space, at most
_MESH_FILE = re.compile(rf"{MESHES}(?:{ROUGH_MESH}|{FURNITURE_MESH})\.msh", re.ASCII)


def require_rock_files(record: Mapping[str, Any], files: Mapping[str, bytes]) -> set[str]:
    """Return the names of the files that show rock; refuse them in a world without, and a world that lacks them.

    Raises
    ------
    BundleError
        Naming the file.
    """
    found = {name for name in files if name == ROCK_TEXTURE or _MESH_FILE.fullmatch(name)}
    if not has_visible_rock(record):
        for name in sorted(found):
            raise BundleError(
                f"{name}: no file of a world that is one volume, as {RECORD} says overlay = {NO_OVERLAY!r}"
            )
    elif ROCK_TEXTURE not in found or len(found) < 2:
        raise BundleError(f"{MESHES if ROCK_TEXTURE in found else ROCK_TEXTURE}: missing")
    return found


def check_rock(files: Mapping[str, bytes], volume: VolumeArrays) -> None:
    """Refuse meshes and a texture that no volume has.

    Raises
    ------
    BundleError
        Naming the file, the value and the limit.
    """
    vertices = volume.facets.vertices
    check_meshes(files, vertices.min(axis=0) - _BEYOND_M, vertices.max(axis=0) + _BEYOND_M, volume.spans.heights_over)
    width, height = check_png(ROCK_TEXTURE, files[ROCK_TEXTURE], (RGB, PALETTE), MOST_PIXELS[ROCK_TEXTURE])
    inflate_png(ROCK_TEXTURE, files[ROCK_TEXTURE])
    if width != height or width < 16:
        raise BundleError(f"{ROCK_TEXTURE}: {width} x {height} px, want a square of 16 px or more")
