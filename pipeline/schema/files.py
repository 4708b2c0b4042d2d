"""The table of a level world's folder: which files it has, and what the binary ones may hold."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from minexplore.bundle import (
    CELLS,
    CLEARANCE_GRID,
    FREE_SPACE,
    HFIELDS,
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
    STOREY_MAPS,
    TOPOLOGY,
    VOLUME,
    BundleError,
    has_rough_floor,
    has_visible_rock,
)
from minexplore.sealed.json_text import read_json
from minexplore.sealed.png import GREY, PALETTE, RGB, check_png
from minexplore.sealed.sizes import MOST_PIXELS, MOST_TILE_PIXELS
from pipeline.schema.meshes import check_meshes
from pipeline.schema.png import inflate_png

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
PICTURES = {PREVIEW: (RGB,), NAV2_PICTURE: (GREY,), ROCK_TEXTURE: (RGB, PALETTE)}
_BEYOND_M = 1.0  # rough rock reaches a little beyond the box of the rock in plan
_BELOW_M, _ABOVE_M = 1.0, 5.0  # and so far below the floor and above the height
_STOREY_MAP = re.compile(STOREY_MAPS, re.ASCII)


def check_contents(record: Mapping[str, Any], files: Mapping[str, bytes], grid: Mapping[str, np.ndarray]) -> None:
    """Refuse meshes, a grid or pictures that a level world cannot have.

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
    west, south, east, north = record["world_m"]
    low = np.array([west - _BEYOND_M, south - _BEYOND_M, -_BELOW_M])
    high = np.array([east + _BEYOND_M, north + _BEYOND_M, record["height_m"] + _ABOVE_M])
    check_meshes(files, low, high)
    for name in PICTURES:
        if has_visible_rock(record) or name not in VISIBLE:
            check_picture(name, files[name])
    _check_fields(record, files)
    _check_grid(grid)
    for name in (FREE_SPACE, TOPOLOGY):
        read_json(name, files[name])


def check_picture(name: str, data: bytes) -> None:
    """Refuse one of `PICTURES` whose kind or size no world has.

    Raises
    ------
    BundleError
        Naming the file, the value and the limit.
    """
    width, height = check_png(name, data, PICTURES[name], MOST_PIXELS[name])
    inflate_png(name, data)
    if name == ROCK_TEXTURE and (width != height or width < 16):
        raise BundleError(f"{name}: {width} x {height} px, want a square of 16 px or more")
    if name == PREVIEW and not 64 <= width <= 4096:
        raise BundleError(f"{name}: {width} x {height} px, want a width of 64 to 4096 px")


def _check_fields(record: Mapping[str, Any], files: Mapping[str, bytes]) -> None:
    """Check the pictures of a rough floor, which a world has if its record states it."""
    fields = sorted(name for name in files if name.startswith(HFIELDS))
    if bool(fields) != has_rough_floor(record):
        raise BundleError(f"{HFIELDS}: {len(fields)} files; {RECORD} states a rough floor with rough_floor = true")
    for name in fields:
        size = check_png(name, files[name], (GREY,), MOST_TILE_PIXELS)
        if min(size) < 2:
            raise BundleError(f"{name}: {size[0]} x {size[1]} px, want 2 or more either way")


def _refuse_visible(files: Mapping[str, bytes]) -> None:
    for name in files:
        if name in VISIBLE or name.startswith((MESHES, HFIELDS)):
            raise BundleError(f"{name}: {RECORD} says overlay = {NO_OVERLAY!r}; such a world has no file of this kind")


def _check_grid(grid: Mapping[str, np.ndarray]) -> None:
    free, clearance = grid["free"], grid["clearance_m"]
    if free.view(np.uint8).max() > 1:
        raise BundleError(f"{CLEARANCE_GRID}: a cell that is neither true nor false")
    if clearance[~free].any():
        raise BundleError(f"{CLEARANCE_GRID}: a clearance above 0 in rock")
