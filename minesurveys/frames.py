"""What all readers share: units, the frame of a file's coordinates, and how a distance is known."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float64, UInt8

Image = UInt8[np.ndarray, "rows cols *channels"]
Mask = Bool[np.ndarray, "rows cols"]
Points2 = Float64[np.ndarray, "n 2"]
Unit = Literal["m", "cm", "mm", "ft", "in"]
METRES: dict[str, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}


@dataclass(frozen=True)
class Georeference:
    """The map from a file's coordinates to the mine frame: metres = (coordinates - `origin`) * `metres_per_unit`.

    `crs` is the reference system that the file names, None for a local grid. Degrees are first projected by
    `projection`. `turned_deg` is the counter-clockwise turn of a picture that brings north up.
    """

    unit: str
    metres_per_unit: float
    origin: tuple[float, float] = (0.0, 0.0)
    crs: str | None = None
    projection: str | None = None
    turned_deg: float = 0.0


METRIC = Georeference("m", 1.0)  # a local grid in metres, like the mine frame


@dataclass(frozen=True)
class Heights:
    """What a survey says of the floor's height: lines along which it is known, spots, or a grade from the entrance.

    Lines and spots are (x, y, z) in m, plan; z is the elevation less `datum_m`. A `grade` is rise over run along the
    drifts, away from the entrance. Spots that are `sampled` are points of a surface, linear between them, that holds in
    the drifts.
    """

    lines: list[list[tuple[float, float, float]]] = field(default_factory=list)
    spots: list[tuple[float, float, float]] = field(default_factory=list)
    grade: float | None = None
    sampled: bool = False
    datum_m: float = 0.0


class Source(IntEnum):
    """How a distance from a station to a wall, the roof or the floor is known."""

    ASSUMED = 0
    INTERPOLATED = 1
    MEASURED = 2
