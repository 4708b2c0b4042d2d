"""Reader of ROS Nav2 maps: `map.yaml` and its picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pipeline.errors import InputError, ParamsError
from pipeline.params.reader_limits import reader_limits
from pipeline.params.reading.plain_yaml import load_plain_yaml
from pipeline.survey.drawing.image import read_image
from pipeline.types import Mask


class _MapFile(BaseModel):
    """The keys of `map.yaml` that are read; other keys are ignored."""

    model_config = ConfigDict(extra="ignore", strict=False)

    image: str
    resolution: float = Field(gt=0)
    origin: tuple[float, float, float]
    negate: bool = False
    occupied_thresh: float = Field(default=0.65, ge=0, le=1)
    free_thresh: float = Field(default=0.25, ge=0, le=1)
    mode: Literal["trinary", "scale", "raw"] = "trinary"


@dataclass(frozen=True)
class Nav2Map:
    """An occupancy grid: `free` and `occupied` (rows, cols), row 0 in the south. All other cells are unknown.

    `origin_m` is the south-west corner of cell [0, 0], `yaw_rad` the rotation about it, `cell_m` the edge of a cell.
    """

    free: Mask
    occupied: Mask
    origin_m: tuple[float, float]
    yaw_rad: float
    cell_m: float


def read_nav2_map(path: Path) -> Nav2Map:
    """Read a map from its YAML file.

    Raises
    ------
    InputError
        If the YAML file does not describe a map, or its picture is missing, not readable or outside the folder.

    References
    ----------
    Nav2 map_server, "Map yaml format". A cell's occupancy is (255 - grey) / 255, or grey / 255 if negated.
    """
    header = _read_map_file(path)
    picture = path.parent / header.image
    if not picture.is_file():
        raise InputError(
            f"{picture}: {'not a plain file' if picture.exists() else 'missing'}, though {path.name} names it"
        )
    grey = cv2.cvtColor(read_image(picture, reader_limits().map_megapixels), cv2.COLOR_BGR2GRAY)
    share = grey[::-1] / 255.0 if header.negate else 1.0 - grey[::-1] / 255.0
    x, y, yaw = header.origin
    if header.mode == "raw":
        value = grey[::-1].astype(float)
        return Nav2Map(value == 0, (value > 0) & (value <= 100), (x, y), yaw, header.resolution)
    return Nav2Map(share < header.free_thresh, share > header.occupied_thresh, (x, y), yaw, header.resolution)


def nav2_picture(path: Path) -> Path:
    """Return the picture that a map's YAML file names.

    Raises
    ------
    InputError
        If the YAML file does not describe a map, or the picture is outside its folder.
    """
    return path.parent / _read_map_file(path).image


def _read_map_file(path: Path) -> _MapFile:
    try:
        header = _MapFile.model_validate(load_plain_yaml(path))
    except ParamsError as error:
        raise InputError(f"{path}: cannot be read as YAML ({str(error).removeprefix(f'{path}:').strip()})") from error
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError(f"{path}: {'.'.join(map(str, first['loc'])) or 'map'}: {first['msg']}") from error
    if not (math.isfinite(header.resolution) and all(map(math.isfinite, header.origin))):
        raise InputError(f"{path}: resolution = {header.resolution}, origin = {header.origin}: expected finite numbers")
    if header.free_thresh > header.occupied_thresh:
        raise InputError(
            f"{path}: free_thresh = {header.free_thresh} exceeds occupied_thresh = {header.occupied_thresh}: "
            "cells would be free and occupied"
        )
    if not header.image.isprintable():
        raise InputError(f"{path}: image = {header.image[:80]!r} holds line breaks or control characters")
    if not (path.parent / header.image).resolve().is_relative_to(path.parent.resolve()):
        raise InputError(f"{path}: image = {header.image[:80]!r} is outside the map's folder")
    return header
