"""Reader of ROS Nav2 maps: `map.yaml` and the picture beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pipeline.errors import InputError
from pipeline.survey.image import read_image
from pipeline.survey.shapes import read_text_bytes
from pipeline.types import Mask

_MAX_MEGAPIXELS = 100.0


class _MapFile(BaseModel):
    """What `map.yaml` may say; other keys are left alone."""

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
    """A map: `free` and `occupied` (rows, cols), row 0 in the south; what is neither is unknown.

    `origin_m` is the south-west corner of the cell [0, 0], `yaw_rad` the grid's turn about it, `cell_m` a cell's edge.
    """

    free: Mask
    occupied: Mask
    origin_m: tuple[float, float]
    yaw_rad: float
    cell_m: float


def read_nav2_map(path: Path) -> Nav2Map:
    """Read a map by its YAML file.

    Raises
    ------
    InputError
        If the YAML is not a map's, or its picture is missing, outside the folder, or none.

    References
    ----------
    Nav2 map_server, "Map yaml format"; a cell's occupancy is (255 - grey) / 255, or grey / 255 where negated.
    """
    said = _read_map_file(path)
    picture = path.parent / said.image
    if not picture.is_file():
        raise InputError(f"{picture}: missing, though {path.name} names it")
    grey = cv2.cvtColor(read_image(picture, _MAX_MEGAPIXELS), cv2.COLOR_BGR2GRAY)
    share = grey[::-1] / 255.0 if said.negate else 1.0 - grey[::-1] / 255.0
    x, y, yaw = said.origin
    if said.mode == "raw":
        value = grey[::-1].astype(float)
        return Nav2Map(value == 0, (value > 0) & (value <= 100), (x, y), yaw, said.resolution)
    return Nav2Map(share < said.free_thresh, share > said.occupied_thresh, (x, y), yaw, said.resolution)


def nav2_picture(path: Path) -> Path:
    """Return the picture that a map's YAML file names.

    Raises
    ------
    InputError
        If the YAML is not a map's, or the picture lies outside its folder.
    """
    return path.parent / _read_map_file(path).image


def _read_map_file(path: Path) -> _MapFile:
    try:
        said = _MapFile.model_validate(yaml.safe_load(read_text_bytes(path)))
    except (UnicodeDecodeError, yaml.YAMLError, RecursionError, ValueError) as error:
        if isinstance(error, ValidationError):
            first = error.errors()[0]
            raise InputError(f"{path}: {'.'.join(map(str, first['loc'])) or 'map'}: {first['msg']}") from error
        raise InputError(f"{path}: cannot be read as YAML ({str(error)[:200]})") from error
    if not (math.isfinite(said.resolution) and all(map(math.isfinite, said.origin))):
        raise InputError(f"{path}: resolution = {said.resolution}, origin = {said.origin}: want finite numbers")
    if not (path.parent / said.image).resolve().is_relative_to(path.parent.resolve()):
        raise InputError(f"{path}: image = {said.image[:80]!r} leads out of the map's folder")
    return said
