"""Reader of ROS Nav2 maps: `map.yaml` and its picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from minesurveys.errors import InputError, ParamsError
from minesurveys.frames import Mask
from minesurveys.guard.plain_yaml import load_plain_yaml
from minesurveys.limits import reader_limits
from minesurveys.pictures.image import decode_pixels
from minesurveys.remarks import warn_user

Mode = Literal["trinary", "scale", "raw"]
_STRIP_ROWS = 512  # so that a map of 100 megapixels needs little memory beside its picture
_RAW_WHITE = 255  # the scale of cells in the mode raw
_FREE, _OCCUPIED, _UNKNOWN = 0, 100, -1


@dataclass(frozen=True)
class CellRules:
    """How a map's file says that shades are read."""

    mode: Mode
    negate: bool
    free_thresh: float
    occupied_thresh: float


def occupancy_of(pixels: np.ndarray, rules: CellRules) -> np.ndarray:
    """Return the occupancy of each pixel: 0 free to 100 occupied, -1 unknown.

    A shade is the mean of the colours. Opacity counts as a fourth colour in the mode trinary; in the mode scale a cell
    that is not opaque is unknown; the mode raw does not look at it.

    Parameters
    ----------
    pixels : (rows, cols) or (rows, cols, 3 or 4) uint8 or uint16
        Grey, or colours and opacity.
    rules : CellRules

    Returns
    -------
    (rows, cols) int8

    References
    ----------
    Nav2 map_server, `loadMapFromFile` in `map_io.cpp`
    """
    found = np.empty(pixels.shape[:2], np.int8)
    for row in range(0, len(found), _STRIP_ROWS):
        strip = pixels[row : row + _STRIP_ROWS]
        strip = strip[..., None] if strip.ndim == 2 else strip
        colours = strip if rules.mode == "trinary" else strip[..., :3]
        white = int(np.iinfo(strip.dtype).max)
        cells = _by_level(rules, colours.shape[2] * white)[colours.sum(axis=2, dtype=np.uint32)]
        if rules.mode == "scale" and strip.shape[2] == 4:
            cells[strip[..., 3] < white] = _UNKNOWN
        found[row : row + _STRIP_ROWS] = cells
    return found


def _by_level(rules: CellRules, most: int) -> np.ndarray:
    """Return the occupancy (most + 1,) of each sum of colours up to `most`, which is white."""
    shade = np.arange(most + 1) / most
    if rules.mode == "raw":
        value = np.rint(shade * _RAW_WHITE)
        return np.where(value <= _OCCUPIED, value, _UNKNOWN).astype(np.int8)
    share = shade if rules.negate else 1.0 - shade
    between = np.full(most + 1, float(_UNKNOWN))
    if rules.mode == "scale" and rules.free_thresh < rules.occupied_thresh:
        between = np.rint((share - rules.free_thresh) / (rules.occupied_thresh - rules.free_thresh) * _OCCUPIED)
    cells = np.where(share > rules.occupied_thresh, _OCCUPIED, np.where(share < rules.free_thresh, _FREE, between))
    return cells.astype(np.int8)


_UNKNOWN_GREY = 205  # what map_saver writes for unknown cells
_EXPECTED = {
    "image": "the name of the map's picture",
    "resolution": "the metres of a cell, more than 0",
    "origin": "three numbers, [x, y, yaw]",
    "negate": "0 or 1",
    "occupied_thresh": "a share from 0 to 1, such as 0.65",
    "free_thresh": "a share from 0 to 1, such as 0.196",
    "mode": "trinary, scale or raw",
}
_OCCUPIED = 100
_OF_OPACITY = {
    "trinary": "in the mode trinary opacity counts as a fourth colour",
    "scale": "in the mode scale they are unknown",
    "raw": "the mode raw does not look at opacity",
}
_LESS_FREE = {False: "0.196", True: "0.147"}  # free_thresh: opacity makes the grey of unknown cells lighter
_LONGEST_BYTES = 255  # of a file's name on Linux


class _MapFile(BaseModel):
    """The keys of `map.yaml` that are read; other keys are ignored."""

    model_config = ConfigDict(extra="ignore", strict=False)

    image: str
    resolution: float = Field(gt=0)
    origin: list[float]
    negate: bool = False
    occupied_thresh: float = Field(default=0.65, ge=0, le=1)
    free_thresh: float = Field(default=0.25, ge=0, le=1)
    mode: Mode = "trinary"


@dataclass(frozen=True)
class Nav2Map:
    """An occupancy grid: `free` and `occupied` (rows, cols), row 0 in the south. All other cells are unknown.

    `origin_m` is the south-west corner of cell [0, 0], `yaw_rad` the rotation about it, `cell_m` the edge of a cell. It
    was read from its `picture`.
    """

    free: Mask
    occupied: Mask
    origin_m: tuple[float, float]
    yaw_rad: float
    cell_m: float
    picture: Path


def read_nav2_map(path: Path) -> Nav2Map:
    """Read a map from its YAML file.

    Raises
    ------
    InputError
        If the YAML file does not describe a map, or its picture is missing, not readable or outside the folder.

    References
    ----------
    Nav2 map_server, "Map yaml format"
    """
    header = _read_map_file(path)
    picture = _picture_of(path, header)
    pixels = _of_whole_numbers(decode_pixels(picture, reader_limits().map_megapixels))
    rules = CellRules(header.mode, header.negate, header.free_thresh, header.occupied_thresh)
    cells = occupancy_of(pixels, rules)
    _warn_of_opacity(path, header, pixels)
    _warn_of_unknown(path, header, pixels, cells)
    x, y, yaw = header.origin
    is_occupied = cells > 0 if header.mode == "raw" else cells == _OCCUPIED
    return Nav2Map((cells == 0)[::-1], is_occupied[::-1], (x, y), yaw, header.resolution, picture)


def _of_whole_numbers(pixels: np.ndarray) -> np.ndarray:
    """Return pixels that are shares of white as numbers of 16 bits; what is no number is black."""
    if pixels.dtype.kind != "f":
        return pixels
    return np.rint(np.nan_to_num(pixels, nan=0.0) * 65535).astype(np.uint16)


def _warn_of_opacity(path: Path, header: _MapFile, pixels: np.ndarray) -> None:
    """Warn of cells that are not opaque, and of what the map's mode makes of them."""
    if pixels.ndim == 2 or pixels.shape[2] < 4:
        return
    clear = int((pixels[..., 3] < np.iinfo(pixels.dtype).max).sum())
    if clear:
        warn_user(f"cells are not opaque: {_OF_OPACITY[header.mode]}, by map_server's rule", of=path.name, count=clear)


def _warn_of_unknown(path: Path, header: _MapFile, pixels: np.ndarray, cells: np.ndarray) -> None:
    """Warn of free cells that have the grey of unknown ones."""
    if header.mode == "raw" or pixels.dtype != np.uint8:
        return
    is_grey = pixels == _UNKNOWN_GREY if pixels.ndim == 2 else (pixels[..., :3] == _UNKNOWN_GREY).all(axis=2)
    unknown = int((is_grey & (cells == 0)).sum())
    if unknown:
        warn_user(
            f"cells of grey {_UNKNOWN_GREY}, often unknown ones, are free by free_thresh = "
            f"{header.free_thresh:g}; {_LESS_FREE[pixels.shape[2:] == (4,)]} leaves them out",
            of=path.name,
            count=unknown,
        )


def files_of_map(path: Path) -> list[Path]:
    """Return a map and its picture: the one that its YAML file names, or the one of that name beside it.

    Raises
    ------
    InputError
        If the YAML file does not describe a map, or the picture is missing or outside its folder.
    """
    return [path, _picture_of(path, _read_map_file(path))]


def _picture_of(path: Path, header: _MapFile) -> Path:
    """Return the plain file below the map's folder that is the longest end of the named path.

    The path may be of another machine, of Windows too, or begin with `../maps` or `$(find package)`. A copy of the map
    and its picture in another folder then reads as the original.
    """
    stated = PurePosixPath(header.image.replace("\\", "/"))
    ends = [PurePosixPath(*stated.parts[start:]) for start in range(len(stated.parts))]
    for end in ends:
        found = path.parent / end
        if end.is_absolute() or ".." in end.parts or not found.is_file() or not _is_below(found, path.parent):
            continue
        if end != stated:
            warn_user(f"the picture {end} beside it is read, as image = {_short(header.image)} is not", of=path.name)
        return found
    image, is_inside = f"image = {_short(header.image)}", _is_below(path.parent / stated, path.parent)
    if is_inside and (path.parent / stated).exists():
        raise InputError(f"{path}: {image} is not a plain file")
    where = "is missing" if is_inside else f"is outside the map's folder, and no plain file {stated.name} is beside it"
    raise InputError(f"{path}: {image} {where}; put the picture beside the map and write its name there")


def _is_below(path: Path, folder: Path) -> bool:
    return path.resolve().is_relative_to(folder.resolve())


def _short(name: str) -> str:
    return name if len(name) <= 40 else f"...{name[-37:]}"


def _read_map_file(path: Path) -> _MapFile:
    try:
        header = _MapFile.model_validate(load_plain_yaml(path))
    except ParamsError as error:
        raise InputError(f"{path}: cannot be read as YAML ({str(error).removeprefix(f'{path}:').strip()})") from error
    except ValidationError as error:
        raise InputError(f"{path}: {_refusal(error)}") from error
    _require_origin(path, header)
    if not math.isfinite(header.resolution):
        raise InputError(f"{path}: resolution = {header.resolution}: expected a finite number, m a cell")
    if header.free_thresh > header.occupied_thresh:
        raise InputError(
            f"{path}: free_thresh = {header.free_thresh} exceeds occupied_thresh = {header.occupied_thresh}: "
            "cells would be free and occupied"
        )
    if not header.image.isprintable():
        raise InputError(f"{path}: image = {header.image[:80]!r} holds line breaks or control characters")
    if len(header.image.encode()) > _LONGEST_BYTES:
        raise InputError(f"{path}: image has {len(header.image.encode())} bytes, the limit is {_LONGEST_BYTES}")
    return header


def _refusal(error: ValidationError) -> str:
    """Return the first key that is missing or wrong, its value, and what is expected."""
    first = error.errors()[0]
    key = str(first["loc"][0]) if first["loc"] else ""
    if key not in _EXPECTED:
        return "not a map: expected keys and values, image, resolution and origin among them"
    if first["type"] == "missing":
        return f"{key} is missing; expected {_EXPECTED[key]}"
    return f"{key} = {first['input']!r:.80}: expected {_EXPECTED[key]}"


def _require_origin(path: Path, header: _MapFile) -> None:
    """Refuse an origin that is not x, y and yaw; old map savers wrote a yaw of nan, or none."""
    stated = ", ".join(f"{value:g}" for value in header.origin[:6])
    if len(header.origin) not in (2, 3) or not all(map(math.isfinite, header.origin[:2])):
        raise InputError(f"{path}: origin = [{stated}]: expected three finite numbers, [x, y, yaw]")
    if len(header.origin) == 2 or not math.isfinite(header.origin[2]):
        x, y = header.origin[:2]
        raise InputError(
            f"{path}: origin = [{stated}] has no yaw; of a map that is not turned write 0: origin: [{x:g}, {y:g}, 0]"
        )
